"""Sixth forms between the recorded command and the actuator."""

from __future__ import annotations

from copy import copy
from types import SimpleNamespace
from typing import Any

import numpy as np

from deeptruck_exam.fleet_trials.commands import STEP_S, planted_filter
from deeptruck_exam.hidden import Array, Effect, Setting, register

HELD = 400  # substeps that are kept


class PlayoutBuffer:
    """A receiver that plays commands out late enough for the latest packet it has met: the delay rises at
    once with a spike of the network, and falls slowly. All trucks of a batch hear the same network."""

    def __init__(self, setting: Setting, p: SimpleNamespace) -> None:
        rng = setting.rng(511)
        slots = int(setting.duration_s / STEP_S) + 6000
        spikes = (rng.random(slots) < STEP_S / p.every_s) * p.spike_s * rng.gamma(2.0, 0.5, slots)
        self.spikes = np.minimum(spikes, 2.5)
        self.base, self.falls = p.base_s, p.falls_s
        self.kept: Array | None = None
        self.reset(0)

    def reset(self, batch: int) -> None:
        self.kept, self.steps, self.late, self.plays = None, 0, self.base, -self.base / STEP_S

    def filter(self, u: Array, time: float, dt: float) -> Array:
        if self.kept is None:
            self.kept = np.repeat(u[None], HELD, axis=0)
        self.kept[self.steps % HELD] = u
        spike = self.base + self.spikes[self.steps % len(self.spikes)]
        self.late = max(spike, self.late - STEP_S * (self.late - self.base) / self.falls)
        # it waits for what is late, and catches up without leaving anything out
        wanted = self.steps - min(self.late / STEP_S, HELD - 2.0)
        self.plays = min(max(self.plays, wanted), self.plays + 2.0)
        self.steps += 1
        return np.asarray(self.kept[round(self.plays) % HELD].copy())

    def __deepcopy__(self, memo: Any) -> PlayoutBuffer:
        twin = copy(self)
        twin.kept = None if self.kept is None else self.kept.copy()
        return twin


class KicksAreDoubted:
    """A kick of the pedal is taken for a slip of the foot: the faster it comes down, the slower torque is
    let in, until the doubt has passed. What is pressed gently comes as fast as the foot."""

    def __init__(self, setting: Setting, p: SimpleNamespace) -> None:
        self.full = setting.truck.full_command
        self.p = p
        self.reset(0)

    def reset(self, batch: int) -> None:
        self.given: Array | None = None
        self.was, self.pace, self.doubt = np.zeros(batch), np.zeros(batch), np.zeros(batch)

    def filter(self, u: Array, time: float, dt: float) -> Array:
        pedal = u[:, 0]
        if self.given is None:
            self.given, self.was = pedal.copy(), pedal.copy()
        p = self.p
        rise = np.maximum(pedal - self.was, 0.0) / self.full
        self.was = pedal.copy()
        # commands come in steps of a tenth of a second, feet do not
        self.pace = self.pace + (rise - dt * self.pace) / 0.3
        kicks = p.doubts * np.maximum(self.pace - 0.2, 0.0)
        self.doubt = np.minimum(self.doubt + dt * (kicks - self.doubt / p.passes_s), 1.0)
        rate = self.full * p.gentle_per_s * (p.doubted / p.gentle_per_s) ** np.clip(self.doubt, 0.0, 1.0)
        up = np.minimum(np.maximum(pedal - self.given, 0.0), dt * rate)
        self.given = np.where(pedal < self.given, pedal, self.given + up)
        return np.stack([self.given, u[:, 1]], axis=1)


register(
    Effect(
        "playout_buffer",
        "command_delay",
        "missing_physics",
        "Ramjee, Kurose, Towsley and Schulzrinne, Adaptive Playout Mechanisms for Packetized Audio"
        " Applications in Wide-Area Networks, IEEE INFOCOM 1994: delay follows spikes of the network at once"
        " and leaves them slowly; remote driving over mobile radio, times are chosen here",
        {"base_s": (0.2, 0.45), "spike_s": (0.25, 0.7), "every_s": (6.0, 25.0), "falls_s": (4.0, 15.0)},
        planted_filter(PlayoutBuffer),
        needs=("suburban", "hills", "descent"),
        accepts=("clock_offset",),
        forms="sixth",
    )
)
register(
    Effect(
        "kicks_are_doubted",
        "command_rate_limit",
        "missing_physics",
        "Acceleration control against pedal error, which takes a fast, deep kick for a mistake (UN Regulation"
        " No. 175 and the Japanese guidelines before it): a limit of the rate that the kick itself sets;"
        " a retrofit that doubts too much, rates are chosen here",
        {
            "gentle_per_s": (0.35, 0.6),
            "doubted": (0.035, 0.09),
            "doubts": (4.0, 10.0),
            "passes_s": (3.0, 9.0),
        },
        planted_filter(KicksAreDoubted),
        needs=("suburban", "hills"),
        accepts=("turbo_lag",),
        forms="sixth",
    )
)
