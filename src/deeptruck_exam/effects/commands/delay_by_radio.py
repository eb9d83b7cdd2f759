"""Commands that arrive late because they come by radio."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from deeptruck_exam.effects.law import STEP_S, Array, Filter, Late, Sizes, State
from deeptruck_exam.effects.planting import hidden, sizes

law = partial(hidden, name="command_delay", accepts="clock_offset")
STEPS = 60000  # of ten minutes


@law("playout_buffer", "sixth", "suburban hills descent")
@sizes(base_s=(0.2, 0.45), spike_s=(0.25, 0.7), every_s=(6.0, 25.0), falls_s=(4.0, 15.0))
class PlayoutBuffer(Late):
    """A receiver that plays commands out late enough for the latest packet it has met: the delay rises at
    once with a spike of the network, and falls slowly. All trucks of a batch hear the same network.
    Source: Ramjee, Kurose, Towsley and Schulzrinne, Adaptive Playout Mechanisms for Packetized Audio
    Applications in Wide-Area Networks, IEEE INFOCOM 1994: delay follows spikes of the network at once and
    leaves them slowly; remote driving over mobile radio, times are chosen here."""

    length = 400

    def prepare(self) -> None:
        rng, p = self.rng(511), self.p
        slots = int(self.setting.duration_s / STEP_S) + 6000
        spikes = (rng.random(slots) < STEP_S / p.every_s) * p.spike_s * rng.gamma(2.0, 0.5, slots)
        self.spikes = np.minimum(spikes, 2.5)

    def start(self, batch: int) -> dict[str, Any]:
        return {**super().start(batch), "late": self.p.base_s, "plays": -self.p.base_s / STEP_S}

    def pass_on(self, p: Sizes, s: State, u: Array, time: float, dt: float) -> Array:
        self.put(s, u)
        spike = p.base_s + self.spikes[s.at % len(self.spikes)]
        s.late = max(spike, s.late - STEP_S * (s.late - p.base_s) / p.falls_s)
        # it waits for what is late, and catches up without leaving anything out
        wanted = s.at - min(s.late / STEP_S, self.length - 2.0)
        s.plays = min(max(s.plays, wanted), s.plays + 2.0)
        return np.asarray(s.past[round(s.plays) % self.length])


@law("slots_of_a_radio", "seventh", "suburban hills descent")
@sizes(frame_s=(0.25, 0.55), base_s=(0.12, 0.35), lost=(0.03, 0.2))
class SlotsOfARadio(Filter):
    """Commands travel in frames: each frame carries what was asked at its start, is played as it ends, and is
    played on where the next one was lost. All trucks of a batch share the radio.
    Source: Radio links of driving robots and platoons in time division (Tanenbaum, Computer Networks): a
    command waits for its slot and for the frame's end, and one that was lost for the next."""

    def prepare(self) -> None:
        self.steps_of = max(2, round(self.p.frame_s / STEP_S))
        self.base = max(1, round(self.p.base_s / STEP_S))
        self.lost = self.rng(711).random(4096) < self.p.lost
        self.lost[1:] &= ~self.lost[:-1]  # what is lost twice is sent another way

    def start(self, batch: int) -> dict[str, Any]:
        return {"steps": 0, "way": []}

    def begin(self, s: State, u: Array) -> None:
        s.given = u.copy()

    def pass_on(self, p: Sizes, s: State, u: Array, time: float, dt: float) -> Array:
        frame, at = divmod(s.steps, self.steps_of)
        if at == 0 and not self.lost[frame % len(self.lost)]:
            s.way.append((s.steps + self.steps_of + self.base, u.copy()))
        while s.way and s.way[0][0] <= s.steps:
            s.given = s.way.pop(0)[1]
        s.steps += 1
        return np.asarray(s.given)


@law("t_waits_for_what_was_lost", "tenth", "suburban hills descent")
@sizes(base_s=(0.22, 0.45), waits_s=(0.35, 0.8), every_s=(2.5, 7.0), again=(0.1, 0.35))
class WaitsForWhatWasLost(Late):
    """Nothing arrives until a lost message has been sent again, then all that waited comes at once; a wait
    that was in vain is followed by one twice as long. All trucks of a batch share the line.
    Source: RFC 6298, Computing TCP's Retransmission Timer (2011), on timeouts that double, and the order that
    TCP keeps (RFC 9293); a remote driver's line, losses are chosen here."""

    length = 600

    def prepare(self) -> None:
        rng, p = self.rng(961), self.p
        self.late, at = np.full(STEPS, round(p.base_s / STEP_S)), 0
        while at < STEPS:
            at += max(1, round(rng.exponential(p.every_s) / STEP_S))
            wait = round(p.waits_s * 2.0 ** min(rng.geometric(1.0 - p.again) - 1, 2) / STEP_S)
            part = self.late[at : at + wait]
            part += np.arange(1, len(part) + 1)
            at += wait + 1

    def pass_on(self, p: Sizes, s: State, u: Array, time: float, dt: float) -> Array:
        self.put(s, u)
        return self.ago(s, int(self.late[s.at % STEPS]))


@law("x_waits_for_the_answer", "thirteenth", "suburban hills descent")
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


@law("u_radio_changes_its_cell", "twenty-first", "suburban hills descent")
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
