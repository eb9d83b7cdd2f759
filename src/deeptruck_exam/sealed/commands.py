"""Messages that wait for an answer, an engine that is spared, a truck that weighs itself, and a map of
bends."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Filter, Hidden, Sizes, State, TorqueFilter, moving, weight
from deeptruck_exam.effects.places import CELL_M, Bends
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")


@law("x_waits_for_the_answer", needs="suburban hills descent", name="command_delay", accepts="clock_offset")
@sizes(way_s=(0.18, 0.4), back_s=(0.1, 0.3), lazy_s=(0.1, 0.3), uneven=(0.1, 0.3))
class WaitsForTheAnswer(Filter):
    """A small message is sent only when the last one has been answered: what changes meanwhile waits, and
    goes as one. After a rest the first message goes at once. way_s: of a message; back_s: of its answer;
    lazy_s: that the receiver keeps an answer for; uneven: of all, by chance.
    Source: Nagle, Congestion Control in IP/TCP Internetworks, RFC 896 (1984), and RFC 1122 (1989) on delayed
    acknowledgements; driving by mobile radio, times are chosen here."""

    def prepare(self) -> None:
        rng, p = self.rng(1321), self.p
        spread = 1.0 + p.uneven * rng.uniform(-1.0, 1.0, 4000)
        self.way, self.answer = p.way_s * spread, (p.back_s + p.lazy_s * rng.random(4000)) * spread

    def begin(self, s: State, u: Array) -> None:
        s.out, s.sent, s.clock = u.copy(), u.copy(), 0.0
        s.lands, s.free = np.zeros((2, len(u)))
        s.count = np.arange(len(u)) * 97

    def pass_on(self, p: Sizes, s: State, u: Array, time: float, dt: float) -> Array:
        s.clock += dt
        s.out = np.where((s.lands <= s.clock)[:, None], s.sent, s.out)
        goes = (s.free <= s.clock) & np.any(u != s.sent, axis=1)
        s.count = np.where(goes, (s.count + 1) % len(self.way), s.count)
        s.sent = np.where(goes[:, None], u, s.sent)
        s.lands = np.where(goes, s.clock + self.way[s.count], s.lands)
        s.free = np.where(goes, s.lands + self.answer[s.count], s.free)
        return np.asarray(s.out)


@law("x_pistons_are_warmed_first", needs="suburban hills", name="command_rate_limit", accepts="turbo_lag")
@sizes(cold_per_s=(0.08, 0.14), warm_per_s=(0.45, 0.9), at=(0.15, 0.3), readies_s=(4.0, 10.0))
@sizes(chills_s=(5.0, 15.0), falls=(3.0, 6.0))
class PistonsAreWarmedFirst(TorqueFilter):
    """A big engine is let up the slower, the longer nothing was asked of it: load makes it ready, rest takes
    that away. Down it goes quickly. cold_per_s, warm_per_s: of the full command; at: of it, that readies in
    the time said; falls: times as quick as up, when ready.
    Source: ISO 8528-5:2022, on load that highly rated engines accept in steps, by mean effective pressure;
    here for each pull of a truck; rates are chosen here."""

    def begin(self, s: State, u: Array) -> None:
        super().begin(s, u)
        s.ready = np.clip(u[:, 0] / self.full / self.p.at, 0.0, 1.0)

    def torque(self, p: Sizes, s: State, pedal: Array, time: float, dt: float) -> Array:
        load = np.clip(s.given / self.full / p.at, 0.0, 1.0)
        slow = np.where(load > s.ready, p.readies_s, p.chills_s)
        s.ready = s.ready + dt * (load - s.ready) / slow
        pace = p.cold_per_s + (p.warm_per_s - p.cold_per_s) * s.ready**2
        down = p.falls * p.warm_per_s * self.full * dt
        return np.asarray(np.clip(pedal, s.given - down, s.given + pace * self.full * dt))


@law("x_weighs_itself", needs="suburban hills highway", name="unknown")
@sizes(most=(0.25, 0.45), half_s=(1.8, 3.5), learns=(0.02, 0.06), doubts_s=(40.0, 120.0), eases_s=(0.2, 0.5))
class WeighsItself(Hidden, unsure=1.0, still=0.0, phase=0.0, asks=0.0, felt=0.0):
    """`unsure` of its own mass after each stand, and slowly again later, a computer moves the torque up and
    down by turns while the engine pulls evenly, until what the truck answers has told it enough; what the
    driver does tells it too. most: of the torque; half_s: of a turn; learns: of `unsure`, for each second and
    0.1 m/s2.
    Source: Fathy, Kang and Stein, Online Vehicle Mass Estimation Using Recursive Least Squares and
    Supervisory Data Extraction, ACC (2008), and Astrom and Wittenmark, Adaptive Control (1995), on dual
    control that probes; sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.felt = s.felt + dt * (view.acceleration - s.felt) / 2.0
        news = np.minimum(np.abs(view.acceleration - s.felt) / 0.1, 4.0)
        s.still = np.where(view.speed < 0.3, s.still + dt, 0.0)
        gains = (1.0 - s.unsure) / p.doubts_s - p.learns * news * s.unsure
        s.unsure = np.where(s.still > 1.0, 1.0, np.clip(s.unsure + dt * gains, 0.0, 1.0))
        s.phase = (s.phase + dt / (2.0 * p.half_s)) % 1.0
        pulls = np.clip((self.pedal(view) - 0.12) / 0.1, 0.0, 1.0) * np.clip(view.speed / 3.0 - 0.5, 0.0, 1.0)
        wants = p.most * np.sqrt(s.unsure) * pulls * np.where(s.phase < 0.5, -1.0, 1.0)
        s.asks = s.asks + dt * (wants - s.asks) / p.eases_s
        return self.at_wheels(view, s.asks * np.maximum(view.engine_torque, 0.0)) * moving(view)


@law("x_slows_before_bends", needs="suburban hills descent", name="unknown")
@sizes(most=(0.025, 0.045), aside_mps2=(0.7, 1.1), ahead_s=(3.0, 6.0), harsh=(0.10, 0.22), lets_s=(0.8, 2.0))
class SlowsBeforeBends(Bends, acts=0.0):
    """A map tells of the bends ahead. Where the truck comes too fast for one, torque is taken and the brakes
    come on softly before it, and are let go in it. most: of the weight; aside_mps2: that it wants in bends;
    harsh: m/s too fast to m/s2.
    Source: Sentouh, Glaser and Mammar, Advanced Vehicle-Infrastructure-Driver Speed Profile for Road
    Departure Accident Prevention, Vehicle System Dynamics 44 (2006): speed for the bend ahead by its
    curvature; bends and sizes are chosen here."""

    def prepare(self) -> None:
        self.bend = np.abs(self.draw_bends(self.rng(1322), 0.018))

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        too_fast = np.zeros_like(view.speed)
        for share in (0.3, 0.65, 1.0):
            way = self.setting.direction * share * p.ahead_s * np.maximum(view.speed, 0.0)
            cell = ((self.place(view) + way) / CELL_M).astype(int) % self.bend.shape[1]
            bears = np.sqrt(p.aside_mps2 / np.maximum(self.bend[self.setting.route, cell], 1e-4))
            too_fast = np.maximum(too_fast, view.speed - bears)
        wants = np.clip(p.harsh * too_fast, 0.0, 9.81 * p.most)
        s.acts = s.acts + dt * (wants - s.acts) / np.where(wants > s.acts, 0.4, p.lets_s)
        return -s.acts / 9.81 * weight(view) * np.clip(view.speed / 2.0 - 1.0, 0.0, 1.0)
