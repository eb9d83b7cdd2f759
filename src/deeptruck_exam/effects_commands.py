"""Hidden effects between the recorded command and the actuator: filters on the commands."""

from __future__ import annotations

from copy import copy
from types import SimpleNamespace
from typing import Any

import numpy as np

from deeptruck_exam.hidden import Array, Effect, Planted, Setting, ou_series, register
from deeptruck_model.trucks import CommandFilter


class Delay:
    """Engine and brake command arrive late, by a time that wanders with the load of the network."""

    def __init__(self, setting: Setting, p: SimpleNamespace) -> None:
        rng = setting.rng(20)
        samples = int(setting.duration_s) + 2
        wander = ou_series(rng, (1, samples), 1.0, 15.0)[0]
        self.delay_s = np.clip(p.delay_s + p.wander_s * wander, 0.02, 1.4)
        self.past = np.zeros((150, 0, 2))
        self.at = -1

    def reset(self, batch: int) -> None:
        self.past, self.at = np.zeros((150, batch, 2)), -1

    def filter(self, u: Array, time: float, dt: float) -> Array:
        if self.at < 0:
            self.past[:] = u
        self.at += 1
        self.past[self.at % 150] = u
        steps = min(round(float(self.delay_s[min(int(time), len(self.delay_s) - 1)]) / dt), self.at, 149)
        return np.asarray(self.past[(self.at - steps) % 150])

    def __deepcopy__(self, memo: Any) -> Delay:
        twin = copy(self)
        twin.past = self.past.copy()
        return twin


class RateLimit:
    """Anti-jerk control: torque builds up at a limited rate that softens near the target, and falls
    faster."""

    def __init__(self, setting: Setting, p: SimpleNamespace) -> None:
        full = setting.truck.full_command
        self.up, self.down = full * p.up_per_s, full * p.up_per_s * p.down_ratio
        self.soft = 0.08 * full
        self.last: Array | None = None

    def reset(self, batch: int) -> None:
        self.last = None

    def filter(self, u: Array, time: float, dt: float) -> Array:
        if self.last is None:
            self.last = u[:, 0].copy()
        away = u[:, 0] - self.last
        rate = np.where(away > 0.0, self.up, self.down) * np.tanh(away / self.soft)
        self.last = self.last + np.clip(rate * dt, -np.abs(away), np.abs(away))
        return np.stack([self.last, u[:, 1]], axis=1)


def _planted(kind: type[Delay] | type[RateLimit]) -> Any:
    def build(setting: Setting, p: SimpleNamespace) -> Planted:
        made: CommandFilter = kind(setting, p)
        return Planted(filters=(made,))

    return build


register(
    Effect(
        "command_delay",
        "command_delay",
        "missing_physics",
        "Nilsson, Real-Time Control Systems with Delays (Lund, 1998): network delay with slow wander; size"
        " chosen for gateways and drive-by-wire retrofits",
        {"delay_s": (0.25, 0.70), "wander_s": (0.01, 0.06)},
        _planted(Delay),
        needs=("suburban", "hills", "descent"),
        accepts=("clock_offset",),
    )
)
register(
    Effect(
        "command_rate_limit",
        "command_rate_limit",
        "missing_physics",
        "Kiencke and Nielsen, Automotive Control Systems (2005), ch. 5: driveline anti-jerk shaping of"
        " demanded torque",
        {"up_per_s": (0.10, 0.28), "down_ratio": (1.0, 3.0)},
        _planted(RateLimit),
        needs=("suburban", "hills"),
        accepts=("turbo_lag",),
    )
)
