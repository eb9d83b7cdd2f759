"""Commands that arrive late."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from deeptruck_exam.effects.law import STEP_S, Array, Filter, Late, Sizes, State
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_exam.effects.series import ou_series

law = partial(hidden, name="command_delay", accepts="clock_offset")


@law("command_delay", "first", "suburban hills descent")
@sizes(delay_s=(0.25, 0.70), wander_s=(0.01, 0.06))
class Delay(Late):
    """Engine and brake command arrive late, by a time that wanders with the load of the network.
    Source: Nilsson, Real-Time Control Systems with Delays (Lund, 1998): network delay with slow wander; size
    chosen for gateways and drive-by-wire retrofits."""

    length = 150

    def prepare(self) -> None:
        samples = int(self.setting.duration_s) + 2
        wander = ou_series(self.rng(20), (1, samples), 1.0, 15.0)[0]
        self.delay_s = np.clip(self.p.delay_s + self.p.wander_s * wander, 0.02, 1.4)

    def pass_on(self, p: Sizes, s: State, u: Array, time: float, dt: float) -> Array:
        self.put(s, u)
        late_s = float(self.delay_s[min(int(time), len(self.delay_s) - 1)])
        return self.ago(s, min(round(late_s / dt), self.length - 1))


@law("good_and_bad_hours", "third", "suburban hills descent")
@sizes(quick_s=(0.15, 0.35), slow_s=(0.6, 1.1), stays_s=(15.0, 45.0))
class GoodAndBadHours(Late):
    """The line is quick or slow, and goes from one to the other by chance.
    Source: Elliott, Estimates of Error Rates for Codes on Burst-Noise Channels, Bell System Tech. J. 42
    (1963): a channel of two states; repeated messages make it slow in the bad one; sizes are chosen here."""

    def prepare(self) -> None:
        rng, p = self.rng(240), self.p
        stays = rng.exponential(p.stays_s, 1 + int(4.0 * self.setting.duration_s / p.stays_s) + 8)
        self.turns = np.cumsum(np.maximum(stays, 1.0))
        self.quick, self.slow = round(p.quick_s / STEP_S), round(p.slow_s / STEP_S)
        self.length = self.slow + 1

    def start(self, batch: int) -> dict[str, Any]:
        return {**super().start(batch), "late": float(self.quick)}

    def pass_on(self, p: Sizes, s: State, u: Array, time: float, dt: float) -> Array:
        self.put(s, u)
        bad = int(np.searchsorted(self.turns, time)) % 2
        # queues drain and fill at half the pace of time, so that commands keep their order
        s.late += float(np.clip((self.slow if bad else self.quick) - s.late, -0.5, 0.5))
        return self.ago(s, round(s.late))


@law("sent_on_change", "fifth", "suburban hills descent")
@sizes(base_s=(0.25, 0.5), queue_s=(0.2, 0.6), delta=(0.01, 0.04), refresh_s=(0.3, 0.8))
class SentOnChange(Filter):
    """A radio link that sends a command when it has changed enough, or after a while; each message waits for
    those before it. All trucks of a batch share the link's moods, not their messages.
    Source: Send-on-delta transmission (Miskowicz, Send-On-Delta Concept: An Event-Based Data Reporting
    Strategy, Sensors 6, 2006) over a link whose messages queue in hurried moments (Kleinrock, Queueing
    Systems, 1975); remote control retrofits, thresholds and times chosen here."""

    longest = 200  # substeps that can be under way

    def prepare(self) -> None:
        p, full = self.p, 1.0 if self.setting.truck.by_deceleration else 30.0
        self.delta = p.delta * np.array([self.full, full])
        self.refresh = round(p.refresh_s / STEP_S)

    def start(self, batch: int) -> dict[str, Any]:
        line = np.full((self.longest, batch, 2), np.nan)
        return {"line": line, "since": np.zeros(batch, int), "busy": np.zeros(batch), "steps": -1}

    def begin(self, s: State, u: Array) -> None:
        s.sent, s.given = u.copy(), u.copy()

    def pass_on(self, p: Sizes, s: State, u: Array, time: float, dt: float) -> Array:
        s.steps += 1
        changed = (np.abs(u - s.sent) > self.delta).any(axis=1)
        s.since = s.since + 1
        now = np.flatnonzero(changed | (s.since >= self.refresh))
        # what hurries comes in rows, and a row makes the link slow
        # slower than time, so that no message overtakes another
        s.busy = np.maximum(s.busy - 0.01, 0.0)
        steps = p.base_s / STEP_S + p.queue_s / STEP_S * s.busy[now]
        late = np.minimum(steps, self.longest - 2.0).astype(int)
        s.line[(s.steps + late) % self.longest, now] = u[now]
        s.sent[now], s.since[now] = u[now], 0
        s.busy[now] = np.minimum(s.busy[now] + 0.25 * changed[now], 1.0)
        slot = s.line[s.steps % self.longest]
        s.given = np.where(np.isnan(slot), s.given, slot)
        slot[:] = np.nan
        return np.asarray(s.given)


@law("n_lower_of_two_tracks", "ninth", "suburban hills")
@sizes(quick_s=(0.2, 0.4), later_s=(0.25, 0.6))
class LowerOfTwoTracks(Late):
    """A pedal that opens waits for the slower track, one that closes for the quicker one.
    Source: Standardized E-Gas Monitoring Concept for Gasoline and Diesel Engine Control Units (EGAS working
    group): two tracks of the pedal are compared and the lower one is used; tracks of unlike latency are
    chosen here."""

    length = 200

    def pass_on(self, p: Sizes, s: State, u: Array, time: float, dt: float) -> Array:
        self.put(s, u)
        quick = self.ago(s, round(p.quick_s / STEP_S))
        slow = self.ago(s, round((p.quick_s + p.later_s) / STEP_S))
        return np.stack([np.minimum(quick[:, 0], slow[:, 0]), quick[:, 1]], axis=1)


@law("e_median_of_the_last", "eleventh", "suburban hills descent")
@sizes(window_s=(0.8, 1.7), line_s=(0.05, 0.2))
class MedianOfTheLast(Late):
    """What is passed on is the middle one of the commands of a window: half a window late, and what lasted
    less than that never arrives.
    Source: Gallagher and Wise, A Theoretical Analysis of the Properties of Median Filters, IEEE Trans.
    Acoustics, Speech, Signal Processing 29 (1981): edges pass, impulses do not; against outliers of a pedal's
    line, windows are chosen here."""

    length = 400
    every = 4

    def prepare(self) -> None:
        middle = round(self.p.window_s / STEP_S / self.every / 2.0)
        first = round(self.p.line_s / STEP_S)
        self.steps = first + self.every * np.arange(2 * middle + 1)

    def pass_on(self, p: Sizes, s: State, u: Array, time: float, dt: float) -> Array:
        self.put(s, u)
        window = s.past[(s.at - self.steps) % self.length]
        middle = len(self.steps) // 2
        return np.asarray(np.partition(window, middle, axis=0)[middle])


@law("k_two_of_three_decide", "fourteenth", "suburban hills descent")
@sizes(
    quick_s=(0.2, 0.4), middle_s=(0.45, 0.75), slow_s=(0.8, 1.3), uneven=(0.15, 0.35), wander_s=(5.0, 20.0)
)
class TwoOfThreeDecide(Late):
    """Three computers pass each command on, each by a way of its own that is quick or slow by turns; what is
    done is what the middle one says, so that nothing happens before the second one has heard. quick_s,
    middle_s, slow_s: of the three ways; uneven: of them, by chance.
    Source: Lyons and Vanderkulk, The Use of Triple-Modular Redundancy to Improve Computer Reliability, IBM
    Journal 6 (1962); a voter behind unlike links, times are chosen here."""

    length = 400

    def prepare(self) -> None:
        p, slots = self.p, int(self.setting.duration_s / 0.1) + 600
        wander = np.exp(p.uneven * ou_series(self.rng(1421), (3, slots), 0.1, p.wander_s))
        late = np.array([[p.quick_s], [p.middle_s], [p.slow_s]]) * wander / STEP_S
        self.late = np.clip(np.rint(late), 5, self.length - 2).astype(int)

    def start(self, batch: int) -> dict[str, Any]:
        return super().start(batch)

    def pass_on(self, p: Sizes, s: State, u: Array, time: float, dt: float) -> Array:
        self.put(s, u)
        three = self.late[:, (s.at // 10) % self.late.shape[1]]
        return np.asarray(np.median([self.ago(s, int(steps)) for steps in three], axis=0))


@law("z_store_runs_over", "seventeenth", "suburban hills descent")
@sizes(least_s=(0.3, 0.5), most_s=(1.2, 2.0), gains=(0.015, 0.05), drops=(0.6, 1.0))
class StoreRunsOver(Late):
    """Commands go through a store between two computers whose clocks differ. The sender's is the quicker one,
    so that the store fills and all comes later and later. When it is full a block of commands is thrown away,
    and the delay falls at once. gains: s of delay in a second; drops: of the store, thrown away.
    Source: Messerschmitt, Synchronization in Digital System Design, IEEE J. Selected Areas in Communications
    8 (1990), on elastic stores that run over and slip; a poor clock, times are chosen here."""

    length = 400

    def start(self, batch: int) -> dict[str, Any]:
        rng = self.rng(1721)
        first = rng.uniform(self.p.least_s, self.p.most_s, len(self.setting.start_m))
        return {**super().start(batch), "held_s": np.resize(first, batch)}

    def pass_on(self, p: Sizes, s: State, u: Array, time: float, dt: float) -> Array:
        self.put(s, u)
        s.held_s = s.held_s + p.gains * dt
        over = s.held_s > p.most_s
        s.held_s = np.where(over, p.most_s - p.drops * (p.most_s - p.least_s), s.held_s)
        back = np.minimum(np.rint(s.held_s / dt), self.length - 2).astype(np.int64)
        return np.asarray(s.past[(s.at - back) % self.length, np.arange(len(u))])


@law("y_waits_until_it_stands_still", "eighteenth", "suburban hills descent")
@sizes(stands_s=(0.35, 0.6), most_s=(1.3, 2.2), band=(0.03, 0.07))
class WaitsUntilItStandsStill(Filter):
    """A receiver believes a command when it has stood still for a moment, within a band. As long as it moves
    on, the old one holds, though not for ever. Each pedal is judged by itself. stands_s: of standing still;
    most_s: of waiting; band: of the full command.
    Source: Ganssle, A Guide to Debouncing (2008), and IEC 61131-2 on filters of inputs that wait for a steady
    value; a slow one, times are chosen here."""

    def start(self, batch: int) -> dict[str, Any]:
        zeros = np.zeros((batch, 2))
        return {"held": zeros.copy(), "near": zeros.copy(), "stood": zeros.copy(), "waited": zeros.copy()}

    def begin(self, s: State, u: Array) -> None:
        s.held, s.near = u.copy(), u.copy()

    def pass_on(self, p: Sizes, s: State, u: Array, time: float, dt: float) -> Array:
        wide = p.band * np.array([self.full, 40.0])
        moves = np.abs(u - s.near) > wide
        s.near = np.where(moves, u, s.near)
        s.stood = np.where(moves, 0.0, s.stood + dt)
        believed = (s.stood > p.stands_s) | (s.waited > p.most_s)
        s.held = np.where(believed, u, s.held)
        s.waited = np.where(np.abs(u - s.held) > wide, s.waited + dt, 0.0)
        return np.asarray(s.held)


@law("h_large_changes_need_long_messages", "nineteenth", "suburban hills descent")
@sizes(least_s=(0.25, 0.45), full_s=(1.5, 3.0))
class LargeChangesNeedLongMessages(Filter):
    """A line sends what has changed, bit by bit: a small change is a short message and a large one a long
    one. The receiver acts when a message is whole, and only then is the next one begun. Each pedal has a
    line of its own. least_s: of the shortest; full_s: more, for a change by the whole pedal.
    Source: Shannon, A Mathematical Theory of Communication (1948), and ITU-T G.726 (1990), on codes that
    send differences; a slow line, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Any]:
        zeros = np.zeros((batch, 2))
        return {"held": zeros.copy(), "sent": zeros.copy(), "left": zeros.copy()}

    def begin(self, s: State, u: Array) -> None:
        s.held, s.sent = u.copy(), u.copy()

    def pass_on(self, p: Sizes, s: State, u: Array, time: float, dt: float) -> Array:
        s.left = s.left - dt
        whole = s.left <= 0.0
        s.held = np.where(whole, s.sent, s.held)
        changed = np.abs(u - s.held) / np.array([self.full, 40.0])
        s.sent = np.where(whole, u, s.sent)
        length = np.where(changed > 0.0, p.least_s + p.full_s * np.minimum(changed, 1.0), 0.0)
        s.left = np.where(whole, length, s.left)
        return np.asarray(s.held)


@law("b_read_at_the_falling_edge", "twentieth", "suburban hills descent")
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
