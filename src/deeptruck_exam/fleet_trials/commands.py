"""Fifth forms between the recorded command and the actuator."""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from types import SimpleNamespace
from typing import Any

import numpy as np

from deeptruck_exam.hidden import Array, Effect, Planted, Setting, register
from deeptruck_model.trucks import CommandFilter

STEP_S = 0.01
LONGEST = 200  # substeps that can be under way


class SentOnChange:
    """A radio link that sends a command when it has changed enough, or after a while; each message waits
    for those before it. All trucks of a batch share the link's moods, not their messages."""

    def __init__(self, setting: Setting, p: SimpleNamespace) -> None:
        full = 1.0 if setting.truck.by_deceleration else 30.0
        self.delta = p.delta * np.array([setting.truck.full_command, full])
        self.refresh, self.base = round(p.refresh_s / STEP_S), p.base_s / STEP_S
        self.queue = p.queue_s / STEP_S
        self.start(0)

    def start(self, batch: int) -> None:
        self.sent, self.given = np.zeros((batch, 2)), np.zeros((batch, 2))
        self.line = np.full((LONGEST, batch, 2), np.nan)
        self.since = np.zeros(batch, int)
        self.busy, self.steps = np.zeros(batch), -1

    def reset(self, batch: int) -> None:
        self.start(batch)

    def filter(self, u: Array, time: float, dt: float) -> Array:
        if self.steps < 0:
            self.sent, self.given = u.copy(), u.copy()
        self.steps += 1
        changed = (np.abs(u - self.sent) > self.delta).any(axis=1)
        self.since = self.since + 1
        now = np.flatnonzero(changed | (self.since >= self.refresh))
        self._send(u, now, changed)
        slot = self.steps % LONGEST
        arrived = ~np.isnan(self.line[slot])
        self.given = np.where(arrived, np.nan_to_num(self.line[slot]), self.given)
        self.line[slot] = np.nan
        return np.asarray(self.given.copy())

    def _send(self, u: Array, now: Any, changed: Any) -> None:
        # what hurries comes in rows, and a row makes the link slow
        # slower than time, so that no message overtakes another
        self.busy = np.maximum(self.busy - 0.01, 0.0)
        late = np.minimum(self.base + self.queue * self.busy[now], LONGEST - 2.0).astype(int)
        self.line[(self.steps + late) % LONGEST, now] = u[now]
        self.sent[now], self.since[now] = u[now], 0
        self.busy[now] = np.minimum(self.busy[now] + 0.25 * changed[now], 1.0)

    def __deepcopy__(self, memo: Any) -> SentOnChange:
        twin = copy(self)
        for name in ("sent", "given", "line", "since", "busy"):
            setattr(twin, name, getattr(self, name).copy())
        return twin


class TorqueBudget:
    """A leaky bucket: small rises pass at once, larger ones have to wait until the budget has filled again,
    and it fills the slower the more torque is given already."""

    def __init__(self, setting: Setting, p: SimpleNamespace) -> None:
        self.full = setting.truck.full_command
        self.most, self.fills, self.slower = p.most * self.full, p.per_s * self.full, p.slower
        self.given: Array | None = None
        self.budget = np.zeros(0)

    def reset(self, batch: int) -> None:
        self.given, self.budget = None, np.full(batch, self.most)

    def filter(self, u: Array, time: float, dt: float) -> Array:
        if self.given is None:
            self.given = u[:, 0].copy()
        share = np.clip(self.given / self.full, 0.0, 1.0)
        rate = self.fills * (1.0 - self.slower * share)
        self.budget = np.minimum(self.budget + dt * rate, self.most)
        rise = np.minimum(np.maximum(u[:, 0] - self.given, 0.0), self.budget)
        self.budget = self.budget - rise
        self.given = np.where(u[:, 0] < self.given, u[:, 0], self.given + rise)
        return np.stack([self.given, u[:, 1]], axis=1)


def planted_filter(kind: Callable[[Setting, SimpleNamespace], CommandFilter]) -> Any:
    """What an effect's `build` is for a filter of the commands."""

    def build(setting: Setting, p: SimpleNamespace) -> Planted:
        return Planted(filters=(kind(setting, p),))

    return build


register(
    Effect(
        "sent_on_change",
        "command_delay",
        "missing_physics",
        "Send-on-delta transmission (Miskowicz, Send-On-Delta Concept: An Event-Based Data Reporting"
        " Strategy, Sensors 6, 2006) over a link whose messages queue in hurried moments (Kleinrock, Queueing"
        " Systems, 1975); remote control retrofits, thresholds and times chosen here",
        {"base_s": (0.25, 0.5), "queue_s": (0.2, 0.6), "delta": (0.01, 0.04), "refresh_s": (0.3, 0.8)},
        planted_filter(SentOnChange),
        needs=("suburban", "hills", "descent"),
        accepts=("clock_offset",),
        forms="fifth",
    )
)
register(
    Effect(
        "torque_budget",
        "command_rate_limit",
        "missing_physics",
        "Token buckets (Turner, New Directions in Communications, IEEE Commun. Mag. 24, 1986) as smoothness"
        " scores and soft launch of fleets' pedals work: a little torque at any time, much only slowly, the"
        " last third slowest; sizes chosen here",
        {"most": (0.03, 0.10), "per_s": (0.07, 0.17), "slower": (0.2, 0.6)},
        planted_filter(TorqueBudget),
        needs=("suburban", "hills"),
        accepts=("turbo_lag",),
        forms="fifth",
    )
)
