"""A stranger's truck in eight truths: what the first line says, how large, and what the correction brings.

The truck is a refuse truck written for this test alone: none of the shipped trucks and none of the exam's.
The simulator has its equations; in each truth the truck has one property that the simulator lacks.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache

import numba
import numpy as np
import pytest
from numpy.typing import NDArray

from deeptruck_core.signals import TruckInterface
from deeptruck_model.mismatch import Mismatch, find_mismatch
from deeptruck_model.mismatch.folders import CORRECTION, REFIT
from deeptruck_model.mismatch.report.lines import headline
from deeptruck_model.recordings import Recording
from deeptruck_model.simulators import Run

Array = NDArray[np.float64]

RATIOS = np.array([3.49, 1.86, 1.41, 1.0, 0.75]) * 5.3 / 0.5  # engine speed over speed, rad/m
UP, DOWN, IDLE = 190.0, 95.0, 63.0  # engine speeds of shifts and at standstill, rad/s
ROTATING, FRICTION = 1.9, 110.0  # kg m^2 at the engine; N m of the engine that is towed
TORQUE, POWER = 1100.0, 175e3  # N m, W
BODY = {"mass": 17500.0, "drag_area": 6.8, "rolling_resistance": 0.009, "torque_gain": 1.0, "brake_gain": 1.0}
DELAY = 4  # rows of 0.1 s
INTERFACE = TruckInterface("refuse", engine_unit="N m", brake_unit="percent", grade=True, fuel=False)


@numba.njit(cache=True)  # type: ignore[untyped-decorator]
def drive_along(state, u, w, fed, body, lacks, dt, y, states):  # type: ignore[no-untyped-def]
    """Drive rows of `state` (batch, 3 + 2 DELAY), which it changes, along u (batch, steps, 2); `fed` is NaN
    where the own response goes on. Writes y and states (batch, steps, ...)."""
    mass, drag_area, rolling_resistance, torque_gain, brake_gain = body
    drags, wind, derate, accessory, late = lacks
    for i in range(len(state)):
        s = state[i]
        for k in range(u.shape[1]):
            engine, brake = (s[3], s[4]) if late else (u[i, k, 0], u[i, k, 1])
            s[3:-2], s[-2:] = s[5:].copy(), u[i, k]
            turns = RATIOS[int(s[1])] * s[0]
            s[1] = min(max(s[1] + (turns > UP) - (turns < DOWN), 0), len(RATIOS) - 1)
            ratio = RATIOS[int(s[1])]
            turns = max(ratio * s[0], IDLE)
            torque = torque_gain * min(engine, TORQUE, POWER / turns) * (1.0 - derate) - accessory / turns
            torque -= FRICTION * (engine <= 0.0)
            pressed = brake_gain * 1000.0 * brake
            s[2] = max(pressed / 6.0, s[2] * np.exp(-dt / 12.0))
            held = pressed + drags * (s[2] - pressed / 6.0)
            air = 0.6 * drag_area * (s[0] + wind) * abs(s[0] + wind)
            rolls = 9.81 * mass * (rolling_resistance + w[i, k, 0])
            force = 0.93 * torque * ratio - held - air - rolls
            before = s[0]
            s[0] = max(before + dt * force / (mass + ROTATING * ratio**2), 0.0)
            y[i, k, 0], y[i, k, 1] = (s[0] - before) / dt, s[0]
            states[i, k] = s[:3]
            if not np.isnan(fed[i, k, 1]):
                s[0] = fed[i, k, 1]


@dataclass(frozen=True)
class Refuse:
    """A batch of refuse trucks with an automatic gearbox. The state is (batch, 3 + 2 DELAY): speed, gear, the
    force of a brake that lets go slowly, and the last commands."""

    body: Mapping[str, float] = field(default_factory=lambda: BODY)
    drags: float = 0.0  # of six brakes, that let go with 12 s
    wind: float = 0.0  # m/s against the truck
    derate: float = 0.0  # of the torque
    accessory: float = 0.0  # W of the engine
    late: float = 0.0  # 1: commands arrive DELAY rows later
    dt: float = 0.1
    interface: TruckInterface = field(default_factory=lambda: INTERFACE)

    def reset(self, y0: Array) -> Array:
        state = np.zeros((len(y0), 3 + 2 * DELAY))
        state[:, 0] = y0[:, 1]
        state[:, 1] = np.argmax(RATIOS * y0[:, 1:2] < 0.9 * UP, axis=1)
        return state

    def _driven(self, state: Array, u: Array, w: Array, fed: Array) -> tuple[Array, Array]:
        y, states = np.empty((*u.shape[:2], 2)), np.empty((*u.shape[:2], 3))
        lacks = np.array([self.drags, self.wind, self.derate, self.accessory, self.late])
        drive_along(state, u, w, fed, np.array(list(self.body.values())), lacks, self.dt, y, states)
        return y, states

    def step(self, state: Array, u: Array, w: Array) -> tuple[Array, Array]:
        state = state.copy()
        y, _ = self._driven(state, u[:, None], w[:, None], np.full((len(u), 1, 2), np.nan))
        return state, y[:, 0]

    def rollout(self, u: Array, w: Array, y0: Array, recorded: Array | None) -> Run:
        fed = np.full((*u.shape[:2], 2), np.nan) if recorded is None else recorded
        state = self.reset(y0)
        first = state[:, None, :3].copy()
        y, states = self._driven(state, u[:, :-1].copy(), w[:, :-1].copy(), fed[:, 1:].copy())
        inside = self.inside(np.concatenate([first, states], axis=1))
        return Run(np.concatenate([y0[:, None], y], axis=1), inside)

    def force(self, state: Array, y: Array) -> Array:
        new = state.copy()
        new[:, 0] = np.where(np.isnan(y[:, 1]), state[:, 0], y[:, 1])
        return new

    def inside(self, state: Array) -> dict[str, Array]:
        ratio = RATIOS[state[..., 1].astype(int)]
        mass = np.full(ratio.shape, self.body["mass"])
        return {
            "gear": state[..., 1] + 1.0,
            "engine_speed": np.maximum(ratio * state[..., 0], IDLE),
            "mass": mass,
            "effective_mass": mass + ROTATING * ratio**2,
        }

    def parameters(self) -> dict[str, float]:
        return dict(self.body)

    def with_parameters(self, values: Mapping[str, float]) -> Refuse:
        return replace(self, body={**self.body, **values})


def drive(truck: Refuse, seed: int, seconds: float = 420.0) -> Recording:
    """A round of collecting, with stops, and the way to the plant over hills; as the sensors have it."""
    rng, n = np.random.default_rng(seed), round(seconds / truck.dt)
    stops = np.repeat(rng.choice([0.0, 4.0, 8.0, 12.0], 12), n // 24)
    wanted = np.concatenate([stops, np.repeat(rng.uniform(9.0, 23.0, 6), n // 12)])
    wanted = np.convolve(np.pad(wanted, 30, "edge"), np.full(61, 1 / 61), "valid")
    x = np.arange(len(wanted)) * truck.dt
    hills = sum(rng.uniform(0.005, 0.015) * np.sin(x / t + rng.uniform(0, 6)) for t in (9.0, 23.0, 40.0))
    state, total = truck.reset(np.zeros((1, 2))), 0.0
    u, y, states = np.zeros((len(x), 2)), np.zeros((len(x), 2)), [state]
    for k in range(len(x) - 1):
        off = wanted[k] - y[k, 1]
        total = float(np.clip(total + 0.02 * off, -0.3, 0.6))
        pull = 0.5 * off + total + rng.normal(0.0, 0.02)
        u[k] = max(TORQUE * min(pull, 1.0), 0.0), max(-25.0 * pull - 3.0, 0.0)
        state, (y[k + 1],) = truck.step(state, u[k : k + 1], hills[k : k + 1, None])
        states.append(state)
    seen = truck.inside(np.concatenate(states))
    speed = np.round((y[:, 1] + rng.normal(0.0, 0.004, len(y))) * 3.6 * 256.0) / 256.0 / 3.6
    channels = {
        "engine_command": u[:, 0], "brake_command": u[:, 1], "grade": hills, "speed": np.maximum(speed, 0.0),
        "acceleration": y[:, 0] + rng.normal(0.0, 0.03, len(y)), "gear": seen["gear"],
        "engine_speed": seen["engine_speed"],
    }  # fmt: skip
    return Recording(f"round{seed}", truck.dt, channels, truck.interface)


@dataclass(frozen=True)
class Truth:
    """The trucks of the drives, the last of which is held out; how the first line begins; a size by finding
    and parameter; the least error as given, and the most that the offered simulator may leave, m/s."""

    trucks: Sequence[Refuse]
    first: str
    size: tuple[str, str, float] | None
    error: tuple[float, float]


def loaded(kg: float) -> Refuse:
    return Refuse({**BODY, "mass": BODY["mass"] + kg})


WRONG = {"mass": 19250.0, "drag_area": 5.4, "rolling_resistance": 0.0108}
TRUTHS = {
    "nothing": Truth([Refuse()] * 5, "Nothing that matters is missing", None, (0.0, 0.05)),
    "load": Truth(
        [loaded(kg) for kg in (1500.0, 3500.0, 5500.0, 2500.0, 4500.0)],
        "Payload change is missing",
        ("payload_change", "change[round2]", 5500.0),
        (0.5, 0.35),  # with the mean load of the fitted drives, 1.25 t below that of the one held out
    ),
    "dragging brake": Truth(
        [Refuse(drags=1.0)] * 5, "Dragging brake is missing", ("dragging_brake", "keeps_s", 12.0), (0.4, 0.05)
    ),
    "headwind": Truth(
        [Refuse(wind=w) for w in (6.0, -6.0, 6.0, -6.0, 6.0)],
        "Most probable cause: headwind",
        ("headwind", "wind[round0]", 6.0),
        (0.5, 0.9),  # the wind of a further drive is not known
    ),
    "derate": Truth(
        [Refuse(derate=d) for d in (0.0, 0.3, 0.0, 0.3, 0.3)],
        "Torque derate is missing",
        ("torque_derate", "loss[round1]", 0.3),
        (1.0, 1.6),  # it acts in some drives, so that nothing is offered
    ),
    "air conditioning": Truth(
        [Refuse(accessory=14e3)] * 5,
        "Most probable cause: accessory load",
        ("accessory_load", "power", 0.93 * 14e3),  # at the wheels
        (1.0, 0.2),
    ),
    "wrong parameters": Truth(
        [Refuse({**BODY, **WRONG})] * 5,
        "Mass .*, drag area .* and rolling resistance .* are wrong together",
        ("refit", "mass", 19250.0),
        (0.4, 0.05),
    ),
    "command delay": Truth(
        [Refuse(late=1.0)] * 5,
        "Most probable cause: command delay",
        ("command_delay", "delay", 0.4),
        (0.2, 0.05),
    ),
}
NARROW = 0.25  # of a size, that its 95 % interval may be to either side


@cache
def found(truth: str) -> Mismatch:
    drives = [drive(truck, seed) for seed, truck in enumerate(TRUTHS[truth].trucks)]
    return find_mismatch(Refuse(), drives[:-1], drives[-1:])


@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "aspect"),
    [(n, a) for n, x in TRUTHS.items() for a in ("first line", "size", "error") if a != "size" or x.size],
)
def test_a_truth(name: str, aspect: str) -> None:
    truth = TRUTHS[name]
    v = found(name).result
    if aspect == "first line":
        assert re.match(truth.first, headline(v))
    elif aspect == "size":
        assert truth.size is not None
        effect, parameter, right = truth.size
        of = {f.effect: f.parameters for f in v.findings} | {"refit": v.fit.refit if v.fit else {}}
        size = of[effect][parameter]
        assert size.ci95 is not None and size.ci95[0] <= right <= size.ci95[1]
        assert size.ci95[1] - size.ci95[0] < 2.0 * NARROW * right
    elif aspect == "error":
        assert v.fit is not None and v.fit.errors is not None
        e = v.fit.errors
        left = {CORRECTION: e.after, REFIT: e.parameters_only}.get(v.offered, e.before)
        assert e.before.speed >= truth.error[0] and left.speed <= truth.error[1]
