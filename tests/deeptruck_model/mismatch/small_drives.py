"""Small drives with a known truth."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np

from deeptruck_model import trucks
from deeptruck_model.mismatch.mechanisms.families import EACH_DRIVE, SLOW
from deeptruck_model.mismatch.posterior import kernels
from deeptruck_model.mismatch.posterior.posterior import Posterior, posterior
from deeptruck_model.mismatch.posterior.regression import Regression
from deeptruck_model.mismatch.residual.evidence import DriveRows, Evidence
from deeptruck_model.mismatch.residual.noise import TAIL, Fit
from deeptruck_model.recordings import Recording
from deeptruck_model.trucks import driving_cycles

TRUCK = trucks.load("trucksim")


class LazyBrake:
    """Brake pressure builds up and falls with a time constant of 0.6 s."""

    def reset(self, batch: int) -> None:
        self.arrived = np.zeros(batch)

    def filter(self, u: np.ndarray, time: float, dt: float) -> np.ndarray:
        self.arrived = self.arrived + (u[:, 1] - self.arrived) * (1.0 - np.exp(-dt / 0.6))
        return np.stack([u[:, 0], self.arrived], axis=1)


class StickingBrake:
    """One brake of six presses with the others, but comes off with a time constant of 20 s."""

    def reset(self, batch: int) -> None:
        self.held = np.zeros(batch)

    def force(self, view: trucks.View, dt: float) -> np.ndarray:
        pressed = np.abs(view.brake_force) / 6.0
        self.held = np.maximum(pressed, self.held * (1.0 - dt / 20.0))
        return np.asarray((pressed - self.held) * (view.speed > 0.5))


def sensed(r: Recording, seed: int, bias: float = 0.0) -> Recording:
    """The drive as sensors record it: acceleration with noise and a bias, speed in the steps of J1939."""
    rng = np.random.default_rng(seed)
    channels = dict(r.channels)
    channels["speed"] = np.round(channels["speed"] * 3.6 * 256.0) / 256.0 / 3.6
    channels["acceleration"] = channels["acceleration"] + bias + rng.normal(0.0, 0.03, len(r))
    return replace(r, channels=channels)


def drives(
    truck: trucks.PhysicsTruck, count: int = 4, seconds: float = 180.0, *, seed: int = 0, bias: float = 0.0
) -> list[Recording]:
    """Drives of a truck, as its sensors record them."""
    return [
        sensed(driving_cycles.drive(truck, seconds=seconds, seed=k), k, bias)
        for k in range(seed, seed + count)
    ]


BRAKE_COMMAND = "brake_command"
N, DT = 6000, 0.2


def evidence(
    force: np.ndarray | float = 0.0, noise: float = 0.03, parts: int = 3, held_out: int = 0
) -> Evidence:
    """Drives of 1200 s in total, with a force (N,), m/s^2, that the simulator lacks; the last ones are held
    out."""
    rng = np.random.default_rng(5)
    time = np.arange(N) * DT
    speed = 18.0 + 4.0 * np.sin(time / 40.0)
    engine = 0.25 + 0.25 * np.sin(time / 11.0) * np.sin(time / 3.1)
    brake = 0.8 * (np.sin(time / 23.0) > 0.9)
    rows = N // parts
    elapsed = np.tile(time[:rows], parts)
    distance = np.concatenate([np.cumsum(part) for part in speed.reshape(parts, rows)]) * DT
    signals = {
        "speed": speed,
        "engine": engine,
        "brake": brake,
        "drag": 1e-4 * speed**2,
        "rolling": np.full(N, 0.06),
        "simulated": engine - brake - 0.1,
        "elapsed": elapsed,
        "distance": distance,
        "place": distance,
        "engine_command": engine,
        BRAKE_COMMAND: brake,
    }
    return Evidence(
        dt=DT,
        drives=tuple(
            DriveRows(name, k * rows, (k + 1) * rows, 0.0, k >= parts - held_out)
            for k, name in enumerate("abc"[:parts])
        ),
        residual=rng.normal(0.0, noise, N) + force,
        simulated=engine - brake - 0.1,
        disagreement=np.zeros(N),
        valid=np.ones(N, dtype=bool),
        signals=signals,
        sensitivity={"torque_gain": engine, "brake_gain": -brake},
        mass=20000.0,
        rerun=lambda name, amount: np.zeros(N),
    )


def braked(e: Evidence, times: int = 12, seconds: float = 6.0) -> tuple[Evidence, np.ndarray]:
    """Evidence with unrecorded braking of 0.8 m/s^2 while the engine is idle, and the rows (N,) of it."""
    on = np.zeros(len(e), dtype=bool)
    rows = round(seconds / e.dt)
    for start in np.linspace(300, len(e) - 300, times).astype(int):
        on[start : start + rows] = True
    command = np.where(on, 0.0, e["engine_command"] + 0.2)
    signals = {k: v for k, v in e.signals.items() if k != BRAKE_COMMAND} | {"engine_command": command}
    return replace(e, residual=e.residual - 0.8 * on, signals=signals), on


FORCES = {
    "none": np.zeros(N),
    "steady": np.full(N, 0.05),
    "drag": -0.25 * 1e-4 * evidence()["speed"] ** 2,
    "brakes": 0.2 * evidence()["brake"],
    EACH_DRIVE: np.repeat([0.08, -0.06, -0.02], N // 3),
    SLOW: 0.06 * np.sin(2 * np.pi * np.arange(N) * DT / 150.0),
}


@cache
def posterior_of(name: str) -> Posterior:
    """The posterior if one of FORCES is missing in the simulator."""
    return posterior(regression(evidence(FORCES[name])), sweeps=60)


def regression(e: Evidence) -> Regression:
    """A regression on evidence with the signals and rows of `evidence()`, whose kernels are made once."""
    return alike(Regression(e), _regression())


def alike(search: Regression, made: Regression) -> Regression:
    """`search` with the kernels of another regression, which has the same signals and rows."""
    assert search.e.signals.keys() == made.e.signals.keys() and np.array_equal(search.rows, made.rows)
    kernels._made[search] = kernels.kernels(made)
    return search


@cache
def _regression() -> Regression:
    return Regression(evidence())


def loss(found: Fit) -> float:
    """Nats that a fit leaves: minus the log likelihood of the Student-t innovations."""
    known = found.innovations[np.isfinite(found.innovations)]
    return float((TAIL + 1) / 2 * np.log1p(known**2 / TAIL).sum() + len(known) * np.log(found.sigma))
