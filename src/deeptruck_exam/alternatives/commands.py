"""Second forms between the recorded command and the actuator."""

from __future__ import annotations

from copy import copy
from types import SimpleNamespace
from typing import Any

import numpy as np

from deeptruck_exam.hidden import Array, Effect, Planted, Setting, register


class SlowBus:
    """Commands are sampled, held until the next message, and some messages are lost."""

    def __init__(self, setting: Setting, p: SimpleNamespace) -> None:
        rng = setting.rng(120)
        slots = int(setting.duration_s / p.period_s) + 5
        arrive = p.period_s * np.arange(slots) + rng.uniform(0.0, 0.3 * p.period_s, slots)
        self.arrive = arrive[np.append(True, rng.random(slots - 1) > p.lost)]
        self.line = max(1, round(p.dead_s / 0.01))
        self.start()

    def start(self, batch: int = 0) -> None:
        self.past = np.zeros((self.line, batch, 2))
        self.held = np.zeros((batch, 2))
        self.steps, self.message = -1, 0

    def reset(self, batch: int) -> None:
        self.start(batch)

    def filter(self, u: Array, time: float, dt: float) -> Array:
        if self.steps < 0:
            self.past[:], self.held = u, u.copy()
        self.steps += 1
        late = self.past[self.steps % self.line].copy()
        self.past[self.steps % self.line] = u
        while self.message < len(self.arrive) and time >= self.arrive[self.message]:
            self.held, self.message = late, self.message + 1
        return np.asarray(self.held)

    def __deepcopy__(self, memo: Any) -> SlowBus:
        twin = copy(self)
        twin.past = self.past.copy()
        return twin


class ProgressiveRelease:
    """Torque is released in proportion to what is there already: slow at first, fast at the end; a lifted
    pedal takes it back at once but for the last part."""

    def __init__(self, setting: Setting, p: SimpleNamespace) -> None:
        self.full = setting.truck.full_command
        self.first, self.growth, self.fall = p.first, p.growth, p.fall
        self.last: Array | None = None

    def reset(self, batch: int) -> None:
        self.last = None

    def filter(self, u: Array, time: float, dt: float) -> Array:
        if self.last is None:
            self.last = u[:, 0].copy()
        there = np.clip(self.last / self.full, 0.0, 1.0)
        up = self.full * (self.first + self.growth * there) * dt
        down = self.full * (self.fall * np.sqrt(there) + 0.05) * dt
        self.last = self.last + np.clip(u[:, 0] - self.last, -down, up)
        return np.stack([self.last, u[:, 1]], axis=1)


def _planted(kind: type[SlowBus] | type[ProgressiveRelease]) -> Any:
    def build(setting: Setting, p: SimpleNamespace) -> Planted:
        return Planted(filters=(kind(setting, p),))

    return build


register(
    Effect(
        "slow_bus",
        "command_delay",
        "missing_physics",
        "Sampling, hold and message loss of a networked control loop: Hespanha, Naghshtabrizi and Xu, A"
        " Survey of Recent Results in Networked Control Systems, Proc. IEEE 95 (2007); sizes are chosen here",
        {"period_s": (0.35, 0.8), "dead_s": (0.12, 0.35), "lost": (0.03, 0.15)},
        _planted(SlowBus),
        needs=("suburban", "hills", "descent"),
        accepts=("clock_offset",),
        forms="second",
    )
)
register(
    Effect(
        "progressive_release",
        "command_rate_limit",
        "missing_physics",
        "Torque brought in gently through the play of the driveline, then faster: Templin and Egardt, An LQR"
        " Torque Compensator for Driveline Oscillation Damping, IEEE CCA (2009), on comfort; the progressive"
        " law is chosen here",
        {"first": (0.03, 0.08), "growth": (0.25, 0.7), "fall": (0.6, 1.5)},
        _planted(ProgressiveRelease),
        needs=("suburban", "hills"),
        accepts=("turbo_lag",),
        forms="second",
    )
)
