"""Times of messages: compares header stamps with log times for each topic in use, chooses one clock for the
bag, and sorts samples by their stamps.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from deeptruck_core.arrays import Array
from deeptruck_core.constants import BACK_S
from deeptruck_core.errors import InputError
from deeptruck_model.recordings.bag_facts import Clock

Index = NDArray[np.int64]

REORDER_NS = round(BACK_S * 1e9)
OVERTAKEN, SELDOM = 3.0, (3, 0.01)  # usual steps by which samples do; how often, in all and of the steps
TAKEN, TWICE = 0.5, 3  # usual steps to a stamp that is there; how often time may not go back onto such ones
MOST_S = 0.5  # that the stamps of two topics may differ by, at the same log time
_SIMULATED_NS = 10**17  # stamps before 1973 are no dates
_LOG_RUNS = 0.1  # of the stamps' own span: messages logged in less were not logged as they came


@dataclass(frozen=True)
class TopicClock:
    """Log times, ascending, of a topic's first message in each second, and its stamp, in ns (n,)."""

    log_ns: Index
    stamps: Index
    stamped: bool


class Clocks:
    """Gives the messages of each topic their times: by `clock` if given, else by stamps if there are any."""

    def __init__(self, clock: Clock | None = None, *, mixed: bool = False) -> None:
        self.clock, self._mixed = clock, mixed
        self._topics: dict[str, TopicClock] = {}

    def timed(self, topic: str, stamps: Index, log_ns: Index, stamped: bool) -> Index:
        """The times (n,) in ns of messages in the order of their log times, from their stamps and log times.
        Of a topic without stamps the log times are passed as stamps."""
        seconds = log_ns // 1_000_000_000
        first = np.flatnonzero(np.diff(seconds, prepend=seconds[0] - 1))
        self._topics[topic] = TopicClock(log_ns[first], stamps[first], stamped)
        return log_ns if self.clock == "log" else stamps

    def remarks(self, bag: Path, reference: str) -> list[str]:
        """Lines on how far the clocks differ, and which one was used.

        Raises InputError if they differ, no clock was chosen and mixed clocks are not allowed, or if stamps
        were chosen and a topic that differs has none.
        """
        differ = self._difference(reference)
        if not differ:
            return []
        bare = [topic for topic, clock in self._topics.items() if not clock.stamped]
        if self.clock == "stamp" and bare:
            raise InputError(
                f"{bag}: {differ}; '--clock stamp' cannot time {' and '.join(bare)}: give '--clock log'"
            )
        if self.clock is None and not self._mixed:
            either = "" if bare else " or '--clock stamp'"
            raise InputError(f"{bag}: {differ}; give '--clock log'{either} to time every topic by one clock")
        chosen = {"log": "log times", "stamp": "stamps"}
        return [
            f"{differ}; " + (f"{chosen[self.clock]} were taken" if self.clock else "each was read by its own")
        ]

    def _difference(self, reference: str) -> str:
        """A sentence if the clocks differ by more than MOST_S, else ''.

        A topic is compared with `reference` at the same log times, so that stamps that run slower or faster
        than the log, as in a simulation, agree with each other. If all messages were logged at once, as by a
        conversion, log times carry no information and stamps are not compared.
        """
        if reference not in self._topics:
            return ""
        times = {topic: (clock.log_ns, clock.stamps) for topic, clock in self._topics.items()}
        log, stamps = times[reference]
        at_once = np.ptp(log) < _LOG_RUNS * np.ptp(stamps) and self._topics[reference].stamped
        apart_s = 0.0
        for topic, (other_log, other_stamps) in times.items():
            if at_once and self._topics[topic].stamped:
                continue
            expected = np.interp((other_log - log[0]) / 1e9, (log - log[0]) / 1e9, (stamps - log) / 1e9)
            apart_s = max(apart_s, abs(float(np.median((other_stamps - other_log) / 1e9 - expected))))
        if apart_s <= MOST_S:
            return ""
        alike: dict[str, list[str]] = {}
        for topic, (log, stamps) in times.items():
            alike.setdefault(_by(self._topics[topic], log, stamps), []).append(topic)
        says = "; ".join(f"{', '.join(topics)}: {by}" for by, topics in alike.items())
        return f"clocks of topics differ by {_size(apart_s)} ({says})"


def _by(clock: TopicClock, log: Index, stamps: Index) -> str:
    """The clock that a topic uses, as text."""
    if not clock.stamped:
        return "no stamps, timed by the log"
    offset_s = float(np.median(stamps - log)) / 1e9
    if stamps[0] < _SIMULATED_NS <= log[0]:
        return f"stamps in simulation time, from {stamps[0] / 1e9:.6g} s"
    if abs(offset_s) < 0.05:
        return "stamps that agree with the log"
    return f"stamps {_size(abs(offset_s))} {'ahead of' if offset_s > 0 else 'behind'} the log"


def _size(seconds: float) -> str:
    return f"{seconds:.1f} s" if seconds < 1e5 else f"{seconds:.3g} s"


def out_of_step(time: Array) -> str:
    """That times (n,) in s, as written, go back again and again by more than samples overtake one another; ''
    if they do not. Sorted, such samples would be scrambled: it is not known which stamps are wrong."""
    steps = np.diff(time)
    back = np.flatnonzero(steps < 0.0)
    falls = -steps[back]
    short = falls <= BACK_S
    usual = float(np.median(np.abs(steps))) if len(steps) else 0.0
    far = falls > OVERTAKEN * usual
    # a sample that was overtaken fills the hole that it left; of a clock that lags the stamps come twice
    there, onto = np.sort(time), time[back + 1]
    taken = (
        np.searchsorted(there, onto + TAKEN * usual, "right") - np.searchsorted(there, onto - TAKEN * usual)
    ) > 1
    seldom = (far & short).sum() <= max(SELDOM[0], SELDOM[1] * len(steps))
    if seldom and (far & short & taken).sum() < TWICE:
        return ""
    at = time[back[far & short]]
    return (
        f"time goes back {len(at)} times, by {np.median(falls[far & short]):.3g} s, about every "
        f"{np.median(np.abs(np.diff(at))):.3g} s: its seconds and their fractions do not change together, or "
        "the stamps are in no order"
    )


@dataclass(frozen=True)
class InOrder:
    """Samples in the order of their stamps: stamps (n,) in ns, columns each (n,); the stamps of messages
    left out because a later message has the same stamp; and how many were put back in order."""

    stamps: Index
    columns: list[Array]
    doubled: Index
    swapped: int


def in_order(topic: str, path: Path, stamps: Index, columns: list[Array]) -> InOrder:
    """Samples as logged, stamps (n,) in ns and columns each (n,), in the order of their stamps; of equal
    stamps the last is used.

    Raises InputError if time goes back by more than REORDER_NS, or is out of step.
    """
    back = np.maximum.accumulate(stamps) - stamps
    if int(back.max(initial=0)) > REORDER_NS:
        at = int(np.argmax(back > REORDER_NS))
        raise InputError(
            f"{path}: time goes back by {back[at] / 1e9:.3g} s on {topic} (message {at}): its clock was set "
            "back, a stamp is wrong, or the bag holds two runs; '--clock log' times the messages by when "
            "they were recorded"
        )
    if says := out_of_step((stamps - stamps[:1]) / 1e9):
        raise InputError(
            f"{path}: on {topic} {says}; '--clock log' times the messages by when they were recorded"
        )
    order = np.argsort(stamps, kind="stable")
    last = np.append(np.diff(stamps[order]) > 0, True)[: len(order)]
    kept = order[last]
    return InOrder(stamps[kept], [c[kept] for c in columns], stamps[order[~last]], int((back > 0).sum()))
