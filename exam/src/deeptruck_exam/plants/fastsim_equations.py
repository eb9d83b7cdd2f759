"""FASTSim's road load solved forwards: `python:deeptruck_exam.plants.fastsim_equations:make`.

A simulator as a user of FASTSim would write it. Powers of a step are divided by its mean speed; the speed
after the step follows by a few iterations of that mean.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from deeptruck_core.arrays import Array
from deeptruck_core.signals import SPEED, TruckInterface
from deeptruck_exam.plants.fastsim_truck import (
    AIR_DENSITY,
    DT,
    GRAVITY,
    INTERFACE,
    RATIO,
    SLOWEST,
    engine_speed,
    inertia,
    sheet,
)
from deeptruck_model.simulators import Run

ROUNDS = 3


def _values() -> dict[str, float]:
    s = sheet()
    return {
        "mass": s["mass"],
        "drag_area": s["drag_coefficient"] * s["frontal_area"],
        "rolling_resistance": s["rolling_resistance"],
        "torque_gain": 1.0,
        "brake_gain": 1.0,
    }


class State(NamedTuple):
    """Speed in m/s, and the forces of the last step by name, each (batch,)."""

    speed: Array
    forces: dict[str, Array]


@dataclass(frozen=True)
class LineHaul:
    """A batch of FASTSim's line-haul truck."""

    values: Mapping[str, float] = field(default_factory=_values)
    interface: TruckInterface = INTERFACE
    dt: float = DT

    def reset(self, y0: Array) -> State:
        """State at y0 (batch, 2)."""
        speed = np.array(y0[:, SPEED], np.float64)
        return State(speed, {name: np.zeros_like(speed) for name in _FORCES})

    def step(self, state: State, u: Array, w: Array) -> tuple[State, Array]:
        """One step under u (batch, 2), engine torque in N m and brake in m/s^2, on the slope w (batch, 1);
        with w (batch, 0) the road is level."""
        p, s, before = self.values, sheet(), state.speed
        grip, angle = s["wheel_friction"] * s["drive_axle_share"], np.arctan(w.sum(axis=1))
        after = before
        for _ in range(ROUNDS):
            mean = np.maximum(0.5 * (before + after), SLOWEST)
            power = np.maximum(u[:, 0] * engine_speed(mean) - s["auxiliary_power"], 0.0)
            traction = p["torque_gain"] * s["transmission_efficiency"] * power / mean
            traction = np.minimum(traction, grip * p["mass"] * GRAVITY)
            drag = 0.5 * AIR_DENSITY * p["drag_area"] * mean**2
            rolling = p["mass"] * GRAVITY * p["rolling_resistance"] * np.cos(angle)
            brake = p["brake_gain"] * p["mass"] * u[:, 1]
            pulled = traction - drag - rolling - p["mass"] * GRAVITY * np.sin(angle) - brake
            after = np.maximum(before + pulled / inertia(p["mass"]) * self.dt, 0.0)
        forces = dict(zip(_FORCES, (traction, brake, drag, rolling), strict=True))
        y = np.stack([(after - before) / self.dt, after], axis=1)
        return State(after, forces), y

    def force(self, state: State, y: Array) -> State:
        """State at a recorded y (batch, 2)."""
        return state._replace(speed=np.where(np.isnan(y[:, SPEED]), state.speed, y[:, SPEED]))

    def inside(self, state: State) -> dict[str, Array]:
        """Forces in N, mass and equivalent mass of the wheels in kg, and the engine signals, each
        (batch,)."""
        s, ones = sheet(), np.ones_like(state.speed)
        turning = engine_speed(state.speed)
        return {
            **state.forces,
            "mass": self.values["mass"] * ones,
            "effective_mass": inertia(self.values["mass"]) * ones,
            "gear": ones,
            "engine_speed": turning,
            "engine_torque": state.forces["traction_force"] * s["wheel_radius"] / RATIO,
        }

    def rollout(self, u: Array, w: Array, y0: Array, recorded: Array | None) -> Run:
        """A free run, or one forced along `recorded`. The only state is speed, so that the steps of a forced
        run are computed in parallel."""
        if recorded is None or np.isnan(recorded[:, :, SPEED]).any():
            return self._one_after_another(u, w, y0, recorded)
        batch, n = u.shape[0], u.shape[1] - 1
        speed = np.concatenate([y0[:, None, SPEED], recorded[:, 1:-1, SPEED]], axis=1)
        flat = (x[:, :-1].reshape(batch * n, -1) for x in (u, w))
        after, y = self.step(State(speed.ravel(), {}), *flat)
        first, rest = self.inside(self.reset(y0)), self.inside(after)
        inside = {name: np.hstack([first[name][:, None], rest[name].reshape(batch, n)]) for name in rest}
        return Run(np.concatenate([y0[:, None], y.reshape(batch, n, 2)], axis=1), inside)

    def _one_after_another(self, u: Array, w: Array, y0: Array, recorded: Array | None) -> Run:
        state, y = self.reset(y0), y0
        responses, insides = [y0], [self.inside(state)]
        for k in range(u.shape[1] - 1):
            state, y = self.step(state, u[:, k], w[:, k])
            responses.append(y)
            insides.append(self.inside(state))
            state = state if recorded is None else self.force(state, recorded[:, k + 1])
        inside = {name: np.stack([i[name] for i in insides], axis=1) for name in insides[0]}
        return Run(np.stack(responses, axis=1), inside)

    def parameters(self) -> dict[str, float]:
        """Parameters that the mismatch tool may refit, in SI."""
        return dict(self.values)

    def with_parameters(self, values: Mapping[str, float]) -> LineHaul:
        """A copy with changed parameters."""
        return replace(self, values={**self.values, **values})


_FORCES = ("traction_force", "brake_force", "drag_force", "rolling_force")


def make(arguments: Mapping[str, Any] | None = None) -> LineHaul:
    """Factory; `arguments` are parameters by name, and `grade: false` for a simulator without slope."""
    values = dict(arguments or {})
    grade = bool(values.pop("grade", True))
    return LineHaul({**_values(), **values}, replace(INTERFACE, grade=grade))
