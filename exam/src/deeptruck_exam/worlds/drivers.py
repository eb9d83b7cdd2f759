"""Drivers: three kinds of people, a cruise control, and an adaptive one (ACC) that follows a leader."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from deeptruck_core.arrays import Array
from deeptruck_exam.laws.law import GRAVITY
from deeptruck_exam.laws.series import ou_series
from deeptruck_exam.worlds.trucks import motoring

PEOPLE = ("calm", "average", "keen")
STANDSTILL_M = 6.0


@dataclass
class Driver:
    """A batch of drivers that turn the speed to follow into engine and brake commands.

    `style` (batch,) is 'human', 'cruise' or 'acc'; `target` (batch, n) is the speed to follow, m/s, for 'acc'
    the leader's. `values` is the entry `drivers` of worlds.yaml; each human driver is of a type drawn from
    PEOPLE.
    """

    truck: SimpleNamespace
    style: NDArray[np.str_]
    target: Array
    headway_s: float
    dt: float
    rng: np.random.Generator
    values: Mapping[str, Any]

    def __post_init__(self) -> None:
        batch, n = self.target.shape
        self.integral, self.wanted, self.pedal, self.foot, self.since = np.zeros((5, batch))
        self.braking, self.brake, self.pulls = np.zeros(batch, bool), np.zeros(batch), np.ones(batch, bool)
        self.human = self.style == "human"
        people, machine = [self.values[name] for name in PEOPLE], self.values["controller"]
        who = self.rng.integers(0, len(people), batch)

        def own(name: str, controller: float) -> Array:
            drawn = [self.rng.uniform(low, high, batch) for low, high in (h[name] for h in people)]
            return np.where(self.human, np.array(drawn)[who, np.arange(batch)], controller)

        self.steps = np.rint(own("ahead_s", machine["ahead_s"]) / self.dt).astype(int)
        self.band, self.gain = own("band_mps", machine["band_mps"]), own("gain_per_s", machine["gain_per_s"])
        self.slow = np.where(self.human, np.array([h["integral"] for h in people])[who], machine["integral"])
        self.moves_at, self.notch = own("moves_at", 0.0), own("notch", 0.0) * self.truck.full_command
        often = own("looks_per_s", np.inf)[:, None] * self.dt
        self.looks = self.rng.random((batch, n)) < often
        self.glider = self.human & (self.rng.random(batch) < np.array([h["glides"] for h in people])[who])
        trembles = [
            size * ou_series(self.rng, (batch, n), self.dt, tau)
            for size, tau in (h["tremble"] for h in people)
        ]
        self.trembles = np.where(self.human[:, None], np.array(trembles)[who, np.arange(batch)], 0.0)

    def act(self, k: int, speed: Array, gap: Array, ratio: Array, engine_speed: Array, grade: Array) -> Array:
        """Commands (batch, 2) at sample k, in the truck's units. All arguments are (batch,): speed (m/s),
        gap (m), overall ratio, engine speed (rad/s) and grade."""
        error = self.target[:, k] - speed
        self.integral = np.clip(self.integral + error * self.dt, -25.0, 25.0) * (speed > 0.5)
        wish = self._wish(k, speed, error, gap)
        self.since += self.dt
        moved = (self.moves_at > 0.0) & (np.abs(wish - self.wanted) > self.moves_at) & (self.since > 0.35)
        now = self.looks[:, k] | moved
        self.since = np.where(now, 0.0, self.since)
        self.wanted = np.where(now, wish, self.wanted)
        u = self._pedals(k, speed, ratio, engine_speed, np.where(self.human, 0.7, 0.9) * grade)
        return self._feet(u, speed, error)

    def _wish(self, k: int, speed: Array, error: Array, gap: Array) -> Array:
        """Desired acceleration, m/s2."""
        rows, last = np.arange(len(error)), self.target.shape[1] - 1
        later = np.minimum(k + self.steps, last)
        coming = (self.target[rows, later] - self.target[:, k]) / (self.steps * self.dt)
        outside = np.sign(error) * np.maximum(np.abs(error) - self.band, 0.0)
        wish = coming + self.gain * outside + 0.03 * error + self.slow * self.integral
        follow = 0.10 * (gap - STANDSTILL_M - self.headway_s * speed) + 0.7 * error
        stops = self.human & (self.target[:, k] < 0.3) & (speed < 3.0)  # or idling would creep on
        wish = np.where(self.style == "acc", follow, np.where(stops, np.minimum(wish, -0.7), wish))
        return np.clip(np.nan_to_num(wish), -2.6, 1.3)

    def _pedals(self, k: int, speed: Array, ratio: Array, engine_speed: Array, grade: Array) -> Array:
        t = self.truck
        resisting = 0.5 * t.air_density * t.drag_area * speed**2 + t.mass * GRAVITY * (
            t.rolling_resistance + grade
        )
        force = 1.03 * t.mass * self.wanted + resisting
        drag = motoring(t, engine_speed)
        coasting = -drag * ratio / t.wheel_radius * (speed > 2.0)
        waiting = (self.target[:, k] < 0.3) & (speed < 1.0)
        patience = np.where(self.human, 0.35, 0.08)  # m/s2; people let a truck coast before they brake
        begin, end = force < coasting - patience * t.mass, force > coasting
        self.braking = np.where(waiting | begin, True, np.where(end, False, self.braking))
        torque = force * t.wheel_radius / np.maximum(ratio * t.driveline_efficiency, 0.5) + drag
        wish = np.clip(torque / t.command_scale, 0.0, t.full_command)
        wish = np.where(self.braking | (torque <= 0.02 * t.peak_torque), 0.0, wish)
        tremble = 1.0 + self.trembles[:, k]
        lag = np.where(self.human, 0.35, 0.12)
        self.pedal += np.clip(self.dt / lag, 0.0, 1.0) * (wish * tremble - self.pedal)
        self.pedal = np.where(self.braking | (self.pedal < 0.005 * t.full_command), 0.0, self.pedal)
        self._press(force - coasting, waiting, tremble, lag)
        return np.stack([self.pedal, self.brake], axis=1)

    def _press(self, excess: Array, waiting: NDArray[np.bool_], tremble: Array, lag: Array) -> None:
        t = self.truck
        share = np.clip(-excess, 0.0, None) / t.brake_capacity
        wish = 100.0 * (t.brake_pushout + (1.0 - t.brake_pushout) * share)
        hold = 25.0
        if t.by_deceleration:
            wish, hold = np.clip(-self.wanted, 0.06, None), 1.0
        wish = np.where(self.braking, np.where(waiting, hold, wish * tremble), 0.0)
        self.brake += np.clip(self.dt / (0.8 * lag), 0.0, 1.0) * (wish - self.brake)
        self.brake = np.where(self.braking, self.brake, 0.0)

    def _feet(self, u: Array, speed: Array, error: Array) -> Array:
        """The engine command after coasting phases and discrete pedal steps."""
        full = self.truck.full_command
        self.pulls = np.where(error > 1.7 * self.band, True, np.where(error < -self.band, False, self.pulls))
        glides = self.glider & ~self.pulls & (speed > 5.0) & (error < 1.7 * self.band)
        self.pedal = np.where(glides, self.pedal * 0.8, self.pedal)
        asked = np.where(glides & (self.pedal < 0.02 * full), 0.0, self.pedal)
        moved = (np.abs(asked - self.foot) > self.notch) | (asked <= 0.0)
        self.foot = np.where(moved, asked, self.foot)
        return np.stack([np.clip(self.foot, 0.0, full), u[:, 1]], axis=1)
