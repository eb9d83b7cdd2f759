"""Who drives: speed profiles of traffic, and a human, a cruise control or an adaptive one that follows
them."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from deeptruck_exam.hidden import GRAVITY, Array, ou_series
from deeptruck_exam.trucks import motoring

Style = Literal["human", "cruise", "acc"]
STANDSTILL_M = 6.0

PLANS = {  # speed range m/s, hold range s, share of stops, acceleration and deceleration ranges m/s2
    "highway": ((17.0, 26.0), (15.0, 50.0), 0.0, (0.15, 0.4), (0.2, 0.9)),
    "suburban": ((6.0, 16.0), (6.0, 25.0), 0.45, (0.4, 0.9), (0.7, 1.8)),
    "hills": ((11.0, 21.0), (15.0, 45.0), 0.05, (0.2, 0.6), (0.3, 1.2)),
    "descent": ((9.0, 18.0), (15.0, 40.0), 0.03, (0.2, 0.5), (0.4, 1.5)),
}


def speed_profile(rng: np.random.Generator, scenario: str, n: int, dt: float) -> Array:
    """Speed the traffic allows, (n,) m/s: holds and ramps drawn from PLANS, with a slow wander."""
    (low, high), holds, stops, rises, falls = PLANS[scenario]
    speed, target = rng.uniform(low, high), rng.uniform(low, high)
    out, rate, hold, stopped = np.empty(n), 0.4, rng.uniform(*holds), False
    for k in range(n):
        step = np.clip(target - speed, -rate * dt, rate * dt)
        speed += step
        if step == 0.0:
            hold -= dt
        if hold <= 0.0:
            stopped = not stopped and rng.random() < stops
            target = 0.0 if stopped else rng.uniform(low, high)
            hold = rng.uniform(2.0, 8.0) if stopped else rng.uniform(*holds)
            rate = rng.uniform(*(rises if target > speed else falls))
        out[k] = speed
    wander = 0.5 * np.convolve(ou_series(rng, (1, n), dt, 12.0)[0], np.hanning(81) / 40.0, mode="same")
    return np.maximum(out + wander * np.clip(out / 8.0, 0.0, 1.0), 0.0)


@dataclass
class Driver:
    """`target` (batch, n): the speed to follow, or the leader's with style 'acc'. A human looks ahead,
    moves the pedals twice a second within a dead band, and forgives half a metre a second; machines do
    neither."""

    truck: SimpleNamespace
    style: NDArray[np.str_]
    target: Array
    headway_s: float
    dt: float
    rng: np.random.Generator

    def __post_init__(self) -> None:
        batch, n = self.target.shape
        self.integral, self.wanted, self.pedal = np.zeros(batch), np.zeros(batch), np.zeros(batch)
        self.braking, self.brake = np.zeros(batch, bool), np.zeros(batch)
        self.human = self.style == "human"
        self.moods = 0.03 * ou_series(self.rng, (batch, n), self.dt, 1.5)
        self.looks = self.rng.random((batch, n)) < np.where(self.human, 2.0 * self.dt, 1.0)[:, None]

    def act(self, k: int, speed: Array, gap: Array, ratio: Array, engine_speed: Array, grade: Array) -> Array:
        """Commands (batch, 2) in the truck's units."""
        ahead = min(k + round(1.0 / self.dt), self.target.shape[1] - 1)
        goal, soon = self.target[:, k], self.target[:, ahead]
        error = goal - speed
        self.integral = np.clip(self.integral + error * self.dt, -25.0, 25.0) * (speed > 0.5)
        steady = np.sign(error) * np.maximum(np.abs(error) - 0.4, 0.0)
        human = (soon - goal) + 0.25 * steady + 0.008 * self.integral
        cruise = (soon - goal) + 0.35 * error + 0.04 * self.integral
        follow = 0.10 * (gap - STANDSTILL_M - self.headway_s * speed) + 0.7 * error
        wish = np.where(self.human, human, np.where(self.style == "acc", follow, cruise))
        self.wanted = np.where(self.looks[:, k], np.clip(np.nan_to_num(wish), -2.6, 1.3), self.wanted)
        return self._pedals(k, speed, ratio, engine_speed, np.where(self.human, 0.7, 0.9) * grade)

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
        mood = np.where(self.human, 1.0 + self.moods[:, k], 1.0)
        lag = np.where(self.human, 0.35, 0.12)
        self.pedal += np.clip(self.dt / lag, 0.0, 1.0) * (wish * mood - self.pedal)
        self.pedal = np.where(self.braking | (self.pedal < 0.005 * t.full_command), 0.0, self.pedal)
        self._press(force - coasting, waiting, mood, lag)
        return np.stack([self.pedal, self.brake], axis=1)

    def _press(self, excess: Array, waiting: NDArray[np.bool_], mood: Array, lag: Array) -> None:
        t = self.truck
        share = np.clip(-excess, 0.0, None) / t.brake_capacity
        wish = 100.0 * (t.brake_pushout + (1.0 - t.brake_pushout) * share)
        hold = 25.0
        if t.by_deceleration:
            wish, hold = np.clip(-self.wanted, 0.06, None), 1.0
        wish = np.where(self.braking, np.where(waiting, hold, wish * mood), 0.0)
        self.brake += np.clip(self.dt / (0.8 * lag), 0.0, 1.0) * (wish - self.brake)
        self.brake = np.where(self.braking, self.brake, 0.0)
