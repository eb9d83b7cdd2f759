"""Third forms between the recorded command and the actuator."""

from __future__ import annotations

from copy import copy
from types import SimpleNamespace
from typing import Any

import numpy as np

from deeptruck_exam.hidden import Array, Effect, Planted, Setting, register


class GoodAndBadHours:
    """The line is quick or slow, and goes from one to the other by chance."""

    def __init__(self, setting: Setting, p: SimpleNamespace) -> None:
        rng = setting.rng(240)
        stays = rng.exponential(p.stays_s, 1 + int(4.0 * setting.duration_s / p.stays_s) + 8)
        self.turns = np.cumsum(np.maximum(stays, 1.0))
        self.quick, self.slow = round(p.quick_s / 0.01), round(p.slow_s / 0.01)
        self.past, self.steps = np.zeros((self.slow + 1, 0, 2)), -1
        self.late = float(self.quick)

    def reset(self, batch: int) -> None:
        self.past, self.steps = np.zeros((self.slow + 1, batch, 2)), -1
        self.late = float(self.quick)

    def filter(self, u: Array, time: float, dt: float) -> Array:
        if self.steps < 0:
            self.past[:] = u
        self.steps += 1
        length = len(self.past)
        self.past[self.steps % length] = u
        bad = int(np.searchsorted(self.turns, time)) % 2
        # queues drain and fill at half the pace of time, so that commands keep their order
        self.late += float(np.clip((self.slow if bad else self.quick) - self.late, -0.5, 0.5))
        return np.asarray(self.past[(self.steps - round(self.late)) % length])

    def __deepcopy__(self, memo: Any) -> GoodAndBadHours:
        twin = copy(self)
        twin.past = self.past.copy()
        return twin


class LimitedJerk:
    """Torque follows with a bounded rate, whose own change is bounded: an S for every step."""

    def __init__(self, setting: Setting, p: SimpleNamespace) -> None:
        full = setting.truck.full_command
        self.rate_most, self.change = full * p.per_s, full * p.per_s / p.builds_s
        self.last: Array | None = None
        self.rate = np.zeros(0)

    def reset(self, batch: int) -> None:
        self.last, self.rate = None, np.zeros(batch)

    def filter(self, u: Array, time: float, dt: float) -> Array:
        if self.last is None:
            self.last = u[:, 0].copy()
        away = u[:, 0] - self.last
        wanted = np.sign(away) * np.minimum(np.sqrt(2.0 * self.change * np.abs(away)), self.rate_most)
        rate = self.rate + np.clip(wanted - self.rate, -self.change * dt, self.change * dt)
        there = (np.abs(away) <= np.abs(rate) * dt) & (rate * away >= 0.0)
        self.last = np.where(there, u[:, 0], np.maximum(self.last + rate * dt, 0.0))
        self.rate = np.where(there, 0.0, rate)
        return np.stack([self.last, u[:, 1]], axis=1)


def _planted(kind: type[GoodAndBadHours] | type[LimitedJerk]) -> Any:
    def build(setting: Setting, p: SimpleNamespace) -> Planted:
        return Planted(filters=(kind(setting, p),))

    return build


register(
    Effect(
        "good_and_bad_hours",
        "command_delay",
        "missing_physics",
        "Elliott, Estimates of Error Rates for Codes on Burst-Noise Channels, Bell System Tech. J. 42 (1963):"
        " a channel of two states; repeated messages make it slow in the bad one; sizes are chosen here",
        {"quick_s": (0.15, 0.35), "slow_s": (0.6, 1.1), "stays_s": (15.0, 45.0)},
        _planted(GoodAndBadHours),
        needs=("suburban", "hills", "descent"),
        accepts=("clock_offset",),
        forms="third",
    )
)
register(
    Effect(
        "limited_jerk",
        "command_rate_limit",
        "missing_physics",
        "Biagiotti and Melchiorri, Trajectory Planning for Automatic Machines and Robots (2008): set-points"
        " of bounded rate and bounded change of rate; sizes of a gentle drive mode, chosen here",
        {"per_s": (0.12, 0.30), "builds_s": (0.8, 2.5)},
        _planted(LimitedJerk),
        needs=("suburban", "hills"),
        accepts=("turbo_lag",),
        forms="third",
    )
)
