"""Command path between recorded commands and truck: delay and rate limit."""

from __future__ import annotations

from typing import Any

import numpy as np

from deeptruck_core.arrays import Array
from deeptruck_exam.laws.catalogue import law, sizes
from deeptruck_exam.laws.law import STEP_S, CommandLaw, Sizes, State
from deeptruck_exam.laws.series import ou_series


class Ring(CommandLaw):
    """Buffer of the last `length` commands (batch, 2)."""

    length: int

    def start(self, batch: int) -> dict[str, Any]:
        return {"past": np.zeros((self.length, batch, 2)), "at": -1}

    def begin(self, s: State, u: Array) -> None:
        s.past[:] = u

    def put(self, s: State, u: Array) -> None:
        s.at += 1
        s.past[s.at % self.length] = u

    def ago(self, s: State, steps: int) -> Array:
        """The command stored `steps` steps before the last one."""
        return np.asarray(s.past[(s.at - steps) % self.length])


@law("command_delay", "suburban hills descent", accepts="clock_offset")
@sizes(delay_s=(0.25, 0.70), wander_s=(0.01, 0.06))
class NetworkDelay(Ring):
    """Engine and brake commands are delayed by a time that varies with the load of the network.
    Source: Nilsson, Real-Time Control Systems with Delays (Lund, 1998)."""

    length = 150

    def prepare(self) -> None:
        samples = int(self.setting.duration_s) + 2
        wander = ou_series(self.rng(20), (1, samples), 1.0, 15.0)[0]
        self.delay_s = np.clip(self.p.delay_s + self.p.wander_s * wander, 0.02, 1.4)

    def pass_on(self, p: Sizes, s: State, u: Array, time: float, dt: float) -> Array:
        self.put(s, u)
        late_s = float(self.delay_s[min(int(time), len(self.delay_s) - 1)])
        return self.ago(s, min(round(late_s / dt), self.length - 1))


@law("command_delay", "suburban hills descent", accepts="clock_offset")
@sizes(period_s=(0.35, 0.8), dead_s=(0.12, 0.35), lost=(0.03, 0.15))
class SampledBus(Ring):
    """Commands are sampled, held until the next message, and some messages are lost.
    Source: Hespanha, Naghshtabrizi and Xu, A Survey of Recent Results in Networked Control Systems, Proc.
    IEEE 95 (2007): sampling, hold and message loss."""

    def prepare(self) -> None:
        rng, p = self.rng(120), self.p
        slots = int(self.setting.duration_s / p.period_s) + 5
        arrive = p.period_s * np.arange(slots) + rng.uniform(0.0, 0.3 * p.period_s, slots)
        self.arrive = arrive[np.append(True, rng.random(slots - 1) > p.lost)]
        self.steps = max(1, round(p.dead_s / STEP_S))
        self.length = self.steps + 1

    def start(self, batch: int) -> dict[str, Any]:
        return {**super().start(batch), "held": np.zeros((batch, 2)), "message": 0}

    def begin(self, s: State, u: Array) -> None:
        super().begin(s, u)
        s.held = u.copy()

    def pass_on(self, p: Sizes, s: State, u: Array, time: float, dt: float) -> Array:
        self.put(s, u)
        while s.message < len(self.arrive) and time >= self.arrive[s.message]:
            s.held, s.message = self.ago(s, self.steps).copy(), s.message + 1
        return np.asarray(s.held)


@law("command_rate_limit", "suburban hills", accepts="turbo_lag")
@sizes(up_per_s=(0.10, 0.28), down_ratio=(1.0, 3.0))
class AntiJerk(CommandLaw):
    """Torque builds up at a limited rate that softens near the target, and falls faster.
    Source: Kiencke and Nielsen, Automotive Control Systems (2005), on driveline anti-jerk control."""

    def begin(self, s: State, u: Array) -> None:
        s.given = u[:, 0].copy()

    def pass_on(self, p: Sizes, s: State, u: Array, time: float, dt: float) -> Array:
        away = u[:, 0] - s.given
        up = self.full * p.up_per_s
        rate = np.where(away > 0.0, up, up * p.down_ratio) * np.tanh(away / (0.08 * self.full))
        s.given = s.given + np.clip(rate * dt, -np.abs(away), np.abs(away))
        return np.stack([s.given, u[:, 1]], axis=1)
