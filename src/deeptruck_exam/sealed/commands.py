"""Commands that arrive late or are followed slowly."""

from __future__ import annotations

from typing import Any

import numpy as np

from deeptruck_exam.effects.law import STEP_S, Array, Late, Sizes, State, TorqueFilter
from deeptruck_exam.effects.planting import hidden, sizes


@hidden("s_busy_bus", "sealed", "suburban hills descent", name="command_delay", accepts="clock_offset")
@sizes(base_s=(0.25, 0.5), busy_s=(0.1, 0.35), calms_s=(2.0, 8.0))
class BusyBus(Late):
    """The more the commands have moved of late, the later they come.
    Source: Tindell, Burns and Wellings, Calculating Controller Area Network Message Response Times, Control
    Engineering Practice 3 (1995): waiting grows with the load of the bus; loads are chosen here."""

    length = 200

    def start(self, batch: int) -> dict[str, Any]:
        return {**super().start(batch), "busy": np.zeros(batch), "late": np.full(batch, self.p.base_s)}

    def begin(self, s: State, u: Array) -> None:
        super().begin(s, u)
        s.was = u.copy()

    def pass_on(self, p: Sizes, s: State, u: Array, time: float, dt: float) -> Array:
        self.put(s, u)
        moved = np.minimum(np.abs(u - s.was).sum(axis=1) / (0.05 * self.full), 1.0)
        s.was = u.copy()
        s.busy = np.minimum(s.busy + 0.25 * moved, 1.0) * (1.0 - dt / p.calms_s)
        s.late = s.late + np.clip(p.base_s + p.busy_s * s.busy - s.late, -dt, dt)
        back = np.rint(s.late / STEP_S).astype(int)
        return np.asarray(s.past[(s.at - back) % self.length, np.arange(len(u))])


@hidden("s_strained_stepper", "sealed", "suburban hills", name="command_rate_limit", accepts="turbo_lag")
@sizes(free_per_s=(0.14, 0.32), spring=(0.5, 0.85), back=(1.2, 2.5))
class StrainedStepper(TorqueFilter):
    """The farther it is open, the slower it opens and the faster it shuts.
    Source: Stepping motors lose speed along their pull-out curve against a return spring (Acarnley, Stepping
    Motors: a Guide to Theory and Practice, 2002); a retrofitted actuator, sizes are chosen here."""

    def torque(self, p: Sizes, s: State, pedal: Array, time: float, dt: float) -> Array:
        share = np.clip(s.given / self.full, 0.0, 1.0)
        up = self.full * p.free_per_s * (1.0 - p.spring * share)
        down = self.full * p.free_per_s * p.back * (1.0 + p.spring * share)
        return np.asarray(s.given + np.clip(pedal - s.given, -down * dt, up * dt))
