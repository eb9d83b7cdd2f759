"""A radio that changes its cell, torque that multiplies, and a shunting mode that stays in."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from deeptruck_exam.effects.law import STEP_S, Array, Hidden, Late, Sizes, State, TorqueFilter, eased, moving
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")


@law(
    "u_radio_changes_its_cell",
    needs="suburban hills descent",
    name="command_delay",
    accepts="clock_offset",
)
@sizes(least_s=(0.25, 0.4), most_s=(0.6, 0.95), stays_s=(9.0, 22.0), breaks_s=(0.4, 0.9))
class RadioChangesItsCell(Late):
    """Commands come by mobile radio. Each cell has a delay of its own, which holds as long as the truck stays
    in it; while it changes to the next one nothing is heard, and what came last is kept. All trucks of a
    batch drive through the same cells.
    Source: 3GPP TR 36.881, Study on Latency Reduction Techniques for LTE (2016), on delays and on breaks at
    handovers; a poor net, times are chosen here."""

    length = 400

    def prepare(self) -> None:
        rng, p = self.rng(2121), self.p
        steps = int(self.setting.duration_s / STEP_S) + 6000
        self.late, self.breaks, at = np.zeros(steps, int), np.zeros(steps, bool), 0
        while at < steps:
            cell = round(p.stays_s * rng.uniform(0.4, 1.8) / STEP_S)
            self.late[at : at + cell] = round(rng.uniform(p.least_s, p.most_s) / STEP_S)
            self.breaks[at : at + round(p.breaks_s * rng.uniform(0.5, 1.5) / STEP_S)] = at > 0
            at += cell

    def start(self, batch: int) -> dict[str, Any]:
        return {**super().start(batch), "heard": np.zeros((batch, 2))}

    def begin(self, s: State, u: Array) -> None:
        super().begin(s, u)
        s.heard = u.copy()

    def pass_on(self, p: Sizes, s: State, u: Array, time: float, dt: float) -> Array:
        self.put(s, u)
        now = min(s.at, len(self.late) - 1)
        if not self.breaks[now]:
            s.heard = self.ago(s, int(self.late[now])).copy()
        return np.asarray(s.heard)


@law("u_torque_multiplies", needs="suburban hills", name="command_rate_limit", accepts="turbo_lag")
@sizes(grows_per_s=(0.5, 0.8), least=(0.1, 0.18), falls_per_s=(1.2, 2.4), calm=(0.5, 0.8))
class TorqueMultiplies(TorqueFilter):
    """So that it does not smoke, an engine may get but a share more fuel each second than it burns now: from
    little it rises slowly, from much fast. Down it goes by a larger share each second. After a lift it grows
    slower still, until it has pulled for a while. least: of the full command, which is there at once; calm:
    of the growth, left after a lift.
    Source: Bosch, Diesel-Engine Management (2014), on the smoke limit by the air that is there; a cautious
    programme, sizes are chosen here."""

    def begin(self, s: State, u: Array) -> None:
        super().begin(s, u)
        s.pulled = np.clip(u[:, 0] / self.full, 0.0, 1.0)

    def torque(self, p: Sizes, s: State, pedal: Array, time: float, dt: float) -> Array:
        s.pulled = eased(s.pulled, np.where(s.given > p.least * self.full, 1.0, 0.0), 3.0, dt)
        grows = p.grows_per_s * (p.calm + (1.0 - p.calm) * s.pulled)
        most = np.maximum(s.given * np.exp(dt * grows), p.least * self.full * min(dt / 0.3, 1.0) + s.given)
        most = np.where(s.given >= p.least * self.full, s.given * np.exp(dt * grows), most)
        low = s.given * np.exp(-dt * p.falls_per_s) - 0.05 * dt * self.full
        return np.clip(pedal, low, most)


@law("u_shunting_mode_stays_in", needs="suburban", name="unknown")
@sizes(power=(1.2, 1.5), out_mps=(5.0, 8.0), least=(0.06, 0.14), leaves_s=(0.8, 2.5), kick=(0.85, 0.95))
class ShuntingModeStaysIn(Hidden, mode=0.0, soft=0.0):
    """A mode for shunting softens the pedal after each stand, so that one can creep to a ramp: a power of the
    pedal is given. It should go out at walking pace, and stays in until the truck is much faster or the pedal
    is pressed to the floor. out_mps: where it goes out; kick: pedal that ends it.
    Source: makers' manuals of automated gearboxes on modes for manoeuvring and their pedal maps; a mode that
    stays in, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        pedal = self.pedal(view)
        ends = (view.speed > p.out_mps) | (pedal > p.kick)
        s.mode = np.where(view.speed < 0.4, 1.0, np.where(ends, 0.0, s.mode))
        s.soft = eased(s.soft, s.mode, np.where(s.mode > s.soft, 0.2, p.leaves_s), dt)
        gives = np.maximum(pedal**p.power, np.minimum(pedal, p.least))
        lacks = s.soft * (pedal - gives) * self.truck.peak_torque
        lacks = np.minimum(lacks, np.maximum(view.engine_torque, 0.0))
        return -self.at_wheels(view, lacks) * moving(view)
