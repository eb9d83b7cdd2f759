"""Values that are read at a falling edge, a wire that shrinks when it is hot, and a pedal that asks for
power."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from deeptruck_exam.effects.law import Array, Filter, Hidden, Sizes, State, TorqueFilter, eased, moving
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")


@law(
    "b_read_at_the_falling_edge",
    needs="suburban hills descent",
    name="command_delay",
    accepts="clock_offset",
)
@sizes(period_s=(0.7, 1.1), way_s=(0.15, 0.35))
class ReadAtTheFallingEdge(Filter):
    """A line carries each value as the length of a pulse, one in a period, and the receiver knows it at the
    falling edge: a small value soon, a large one only as the period ends. Each pedal has a line of its own.
    way_s: from the pedal to the start of the next pulse, at least.
    Source: Barrett and Pack, Microcontrollers Fundamentals for Engineers and Scientists (2006), on capture of
    pulse widths; a slow line, times are chosen here."""

    def start(self, batch: int) -> dict[str, Any]:
        clock = np.array([0.0, 0.37]) * self.p.period_s + np.zeros((batch, 2))
        zeros = np.zeros((batch, 2))
        return {"clock": clock, "pulse": zeros.copy(), "held": zeros.copy(), "seen": zeros.copy()}

    def begin(self, s: State, u: Array) -> None:
        s.pulse, s.held, s.seen = u.copy(), u.copy(), u.copy()

    def pass_on(self, p: Sizes, s: State, u: Array, time: float, dt: float) -> Array:
        s.clock = s.clock + dt
        ends = s.clock >= p.period_s
        s.held = np.where(ends, s.pulse, s.held)  # at the latest
        s.pulse = np.where(ends, s.seen, s.pulse)
        s.clock = np.where(ends, s.clock - p.period_s, s.clock)
        reads = s.clock <= p.period_s - p.way_s
        s.seen = np.where(reads, u, s.seen)
        wide = np.clip(np.abs(s.pulse) / np.array([self.full, 40.0]), 0.05, 0.95) * p.period_s
        s.held = np.where(s.clock >= wide, s.pulse, s.held)
        return np.asarray(s.held)


@law("b_wire_shrinks_when_hot", needs="suburban hills", name="command_rate_limit", accepts="turbo_lag")
@sizes(heats_per_s=(0.2, 0.36), cools_per_s=(0.45, 0.8), least=(0.1, 0.25), soaks_s=(15.0, 45.0))
@sizes(soaked=(0.3, 0.6))
class WireShrinksWhenHot(TorqueFilter):
    """A wire of a metal that shrinks when it is hot draws the throttle open: current heats it, against what
    the air takes, so that it opens ever more slowly. It shuts as it cools, fast from wide open and slowly
    near shut, and slowest where long pulls have warmed its `case`. heats_per_s: of the full command, from
    cold; cools_per_s: from wide open, in a cold case; least: of the paces; soaked: of the cooling, lost.
    Source: Lagoudas, Shape Memory Alloys (2008), on actuators that are heated by current and cool by
    themselves; a thick wire, sizes are chosen here."""

    def begin(self, s: State, u: Array) -> None:
        super().begin(s, u)
        s.case = np.clip(0.5 * u[:, 0] / self.full, 0.0, 1.0)

    def torque(self, p: Sizes, s: State, pedal: Array, time: float, dt: float) -> Array:
        wide = np.clip(s.given / self.full, 0.0, 1.0)
        s.case = eased(s.case, wide, p.soaks_s, dt)
        opens = p.heats_per_s * (p.least + (1.0 - p.least) * (1.0 - wide))
        shuts = p.cools_per_s * (p.least + (1.0 - p.least) * wide) * (1.0 - p.soaked * s.case)
        return np.clip(pedal, s.given - dt * shuts * self.full, s.given + dt * opens * self.full)


@law("b_pedal_asks_for_power", needs="suburban hills highway", name="unknown")
@sizes(blend=(0.5, 0.9), at_rads=(120.0, 150.0), most=(0.3, 0.5), late_s=(0.2, 0.7), fades_s=(2.0, 8.0))
class PedalAsksForPower(Hidden, given=0.0, blended=0.5):
    """The pedal is taken for a share of power and not of torque: the engine gives more than was known while
    it turns slowly and less while it turns fast. After each change of gear the programme comes back bit by
    bit. blend: of the programme, over the usual one; at_rads: where both ask for the same; most: of peak
    torque.
    Source: Guzzella and Sciarretta, Vehicle Propulsion Systems (2013), on what a pedal may ask for; the
    programme and its sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        pedal = self.pedal(view)
        s.blended = np.where(view.shifting > 0.5, 0.0, eased(s.blended, p.blend, p.fades_s, dt))
        turns = np.clip(p.at_rads / np.maximum(view.engine_speed, 60.0), 0.5, 2.0)
        wish = np.clip(s.blended * pedal * (turns - 1.0), -p.most, p.most)
        s.given = eased(s.given, np.clip(wish, -pedal, 1.0 - pedal), p.late_s, dt)
        return self.at_wheels(view, s.given * self.truck.peak_torque) * moving(view)
