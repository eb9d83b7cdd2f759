"""What a truck's forces see along driven drives, as arrays; and the carriers and drivers of grammar laws.

A carrier is a force (batch, n) in N that acts along the drives whatever a law then makes of it: brake force,
drag, pull at the wheels, weight. A driver is a signal (batch, n) >= 0 by which a law's size may change.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np

from deeptruck_exam.cases.trace import Trace
from deeptruck_exam.laws.law import GRAVITY, Array, Setting
from deeptruck_exam.laws.series import lagged
from deeptruck_model.trucks import View


@dataclass(frozen=True)
class Signals:
    """Views of a batch of drives: `of` has each field of View as (batch, n), `command` for u."""

    of: Mapping[str, Array]
    setting: Setting

    @staticmethod
    def of_trace(trace: Trace, samples: int) -> Signals:
        """The views of a trace as arrays of so many samples; the last view is held."""
        at = np.minimum(np.arange(samples), len(trace.views) - 1)
        names = [name for name in View.__annotations__ if name not in ("time", "u")]
        of = {name: np.stack([getattr(view, name) for view in trace.views], axis=1)[:, at] for name in names}
        of["command"] = np.stack([view.u[:, 0] for view in trace.views], axis=1)[:, at]
        return Signals(of, trace.setting)

    def __getattr__(self, name: str) -> Array:
        try:
            return self.of[name]
        except KeyError:
            raise AttributeError(name) from None

    @property
    def truck(self) -> SimpleNamespace:
        return self.setting.truck

    @property
    def dt(self) -> float:
        return self.setting.dt

    @property
    def time(self) -> Array:
        return np.broadcast_to(np.arange(self.speed.shape[1]) * self.dt, self.speed.shape)

    @property
    def moving(self) -> Array:
        return np.clip(self.speed / 0.5, 0.0, 1.0)

    @property
    def place(self) -> Array:
        """Position on the road, m, whichever way it is driven."""
        s = self.setting
        return s.start_m[:, None] + s.direction[:, None] * self.distance

    @property
    def force_per_torque(self) -> Array:
        """Force at the road for each N m at the flywheel, 1/m; zero while a shift opens the driveline."""
        return self.ratio / self.truck.wheel_radius * (1.0 - self.shifting)

    @property
    def since_shift(self) -> Array:
        """Seconds since the last change of gear; 99 before the first."""
        before = np.concatenate([self.gear[:, :1], self.gear[:, :-1]], axis=1)
        changed = (self.gear != before) | (self.shifting > 0.0)
        count = np.arange(self.gear.shape[1])
        last = np.maximum.accumulate(np.where(changed, count, -(10**6)), axis=1)
        return np.minimum((count - last) * self.dt, 99.0)

    @property
    def closed(self) -> Array:
        """Whether the engine is asked for nothing, 0 or 1."""
        return (self.command <= 0.01 * abs(self.truck.full_command)).astype(float)

    @property
    def power_share(self) -> Array:
        return np.maximum(self.engine_torque, 0.0) * self.engine_speed / self.truck.peak_power

    @property
    def gap(self) -> Array:
        """Metres to the leader; endless where nobody drives ahead."""
        leader = self.setting.leader_m[:, : self.distance.shape[1]]
        return np.nan_to_num(leader - self.distance, nan=1e5)


def _weight(s: Signals) -> Array:
    return s.mass * GRAVITY * s.moving


CARRIERS: Mapping[str, Callable[[Signals], Array]] = {
    "weight": _weight,
    "rolling_force": lambda s: s.rolling_force * s.moving,
    "drag_force": lambda s: s.drag_force,
    "brake_force": lambda s: s.brake_force * s.moving,
    "control_force": lambda s: s.traction_force - s.brake_force * s.moving,
    "traction": lambda s: s.traction_force,
    "pull": lambda s: np.maximum(s.traction_force, 0.0),
    "push": lambda s: np.maximum(-s.traction_force, 0.0),
    "carried": lambda s: np.abs(s.traction_force),
    "delivered": lambda s: np.maximum(s.engine_torque, 0.0) * s.force_per_torque,
    "engine_constant": lambda s: 0.1 * s.truck.peak_torque * s.force_per_torque * s.moving,
    "engine_speed": lambda s: (
        0.1 * s.truck.peak_torque * s.engine_speed / 150.0 * s.force_per_torque * s.moving
    ),
    "engine_speed_squared": lambda s: (
        0.1 * s.truck.peak_torque * (s.engine_speed / 150.0) ** 2 * s.force_per_torque * s.moving
    ),
    "engine_power": lambda s: (
        0.1 * s.truck.peak_torque * 150.0 / np.maximum(s.engine_speed, 50.0) * s.force_per_torque * s.moving
    ),
    "mass_times_acceleration": lambda s: s.mass * s.acceleration * s.moving,
    "engine_inertia": lambda s: (
        np.minimum(s.force_per_torque**2 * (s.speed > 1.5), 0.5 * s.mass) * np.clip(s.acceleration, -4.0, 4.0)
    ),
    "load": lambda s: s.mass * (s.acceleration + GRAVITY * (s.grade + s.truck.rolling_resistance)) * s.moving,
    "pushed_mass": lambda s: np.maximum(-s.mass * (s.acceleration + GRAVITY * s.grade), 0.0) * s.moving,
}

DRIVERS: Mapping[str, Callable[[Signals], Array]] = {
    "speed": lambda s: s.speed / 25.0,
    "slow": lambda s: np.exp(-s.speed / 5.0),
    "engine_speed": lambda s: s.engine_speed / 200.0,
    "engine_load": lambda s: np.maximum(s.engine_torque, 0.0) / s.truck.peak_torque,
    "engine_power": lambda s: s.power_share,
    "brake_power": lambda s: s.brake_force * s.speed / (s.mass * 5.0),
    "brake_force": lambda s: s.brake_force / (s.mass * 2.0),
    "pedal": lambda s: np.clip(s.command / s.truck.full_command, 0.0, 1.0),
    "pull": lambda s: np.maximum(s.traction_force, 0.0) / (s.mass * 1.0),
    "acceleration": lambda s: np.abs(s.acceleration) / 1.5,
    "time": lambda s: s.time / s.setting.duration_s,
    "distance": lambda s: s.distance / 5000.0,
    "tyre_work": lambda s: lagged(s.speed / 20.0, 200.0, s.dt),
    "since_shift": lambda s: np.exp(-s.since_shift / 2.0),
    "near_leader": lambda s: 1.0 / (1.0 + np.maximum(s.gap, 1.0) / 25.0),
    "slope": lambda s: np.maximum(s.grade, 0.0) / 0.05,
    "low_gear": lambda s: np.clip(s.ratio / 20.0, 0.0, 1.0),
    "closed": lambda s: s.closed,
}
