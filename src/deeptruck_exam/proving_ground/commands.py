"""Seventh forms between the recorded command and the actuator."""

from __future__ import annotations

from copy import copy
from types import SimpleNamespace
from typing import Any

import numpy as np

from deeptruck_exam.fleet_trials.commands import STEP_S, planted_filter
from deeptruck_exam.hidden import Array, Effect, Setting, register


class SlotsOfARadio:
    """Commands travel in frames: each frame carries what was asked at its start, is played as it ends, and
    is played on where the next one was lost. All trucks of a batch share the radio."""

    def __init__(self, setting: Setting, p: SimpleNamespace) -> None:
        rng = setting.rng(711)
        self.steps_of = max(2, round(p.frame_s / STEP_S))
        self.base = max(1, round(p.base_s / STEP_S))
        self.lost = rng.random(4096) < p.lost
        self.lost[1:] &= ~self.lost[:-1]  # what is lost twice is sent another way
        self.reset(0)

    def reset(self, batch: int) -> None:
        self.steps = 0
        self.given: Array | None = None
        self.way: list[tuple[int, Array]] = []

    def filter(self, u: Array, time: float, dt: float) -> Array:
        if self.given is None:
            self.given = u.copy()
        frame, at = divmod(self.steps, self.steps_of)
        if at == 0 and not self.lost[frame % len(self.lost)]:
            self.way = [*self.way, (self.steps + self.steps_of + self.base, u.copy())]
        while self.way and self.way[0][0] <= self.steps:
            self.given, self.way = self.way[0][1], self.way[1:]
        self.steps += 1
        return self.given.copy()

    def __deepcopy__(self, memo: Any) -> SlotsOfARadio:
        return copy(self)  # arrays and lists are replaced, never changed


class RobotsProfile:
    """A driving robot's leg goes to where the pedal is wanted by a profile of limited jerk: it gathers
    pace, runs at most so fast, and slows down in time."""

    def __init__(self, setting: Setting, p: SimpleNamespace) -> None:
        self.full, self.p = setting.truck.full_command, p
        self.reset(0)

    def reset(self, batch: int) -> None:
        self.at: Array | None = None
        self.pace = np.zeros(batch)

    def filter(self, u: Array, time: float, dt: float) -> Array:
        if self.at is None:
            self.at, self.pace = u[:, 0].copy(), np.zeros(len(u))
        p, left = self.p, (u[:, 0] - self.at) / self.full
        side = np.where(left < 0.0, -1.0, 1.0)
        away = np.where(left < 0.0, p.back, 1.0)
        gathers = p.gathers_per_s2 * away
        most = np.minimum(np.sqrt(2.0 * gathers * np.abs(left)), p.most_per_s * away)
        towards = side * self.pace
        towards = towards + np.clip(most - towards, -2.0 * gathers * dt, gathers * dt)
        self.pace = side * towards
        near = (np.abs(left) < 2e-4) | (np.abs(left) < np.abs(self.pace) * dt)
        self.pace = np.where(near, 0.0, self.pace)
        self.at = np.where(near, u[:, 0], self.at + dt * self.pace * self.full)
        return np.stack([np.maximum(self.at, 0.0), u[:, 1]], axis=1)


register(
    Effect(
        "slots_of_a_radio",
        "command_delay",
        "missing_physics",
        "Radio links of driving robots and platoons in time division (Tanenbaum, Computer Networks): a"
        " command waits for its slot and for the frame's end, and one that was lost for the next",
        {"frame_s": (0.25, 0.55), "base_s": (0.12, 0.35), "lost": (0.03, 0.2)},
        planted_filter(SlotsOfARadio),
        needs=("suburban", "hills", "descent"),
        accepts=("clock_offset",),
        forms="seventh",
    )
)
register(
    Effect(
        "robots_profile",
        "command_rate_limit",
        "missing_physics",
        "Driving robots move pedals by profiles of limited speed and acceleration, slower down than back"
        " (Biagiotti and Melchiorri, Trajectory Planning for Automatic Machines and Robots, 2008)",
        {"most_per_s": (0.07, 0.16), "gathers_per_s2": (0.05, 0.16), "back": (1.5, 4.0)},
        planted_filter(RobotsProfile),
        needs=("suburban", "hills"),
        accepts=("turbo_lag",),
        forms="seventh",
    )
)
