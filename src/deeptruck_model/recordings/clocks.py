"""Times of messages: compares header stamps with log times for each topic in use, chooses one clock for the
bag, and sorts samples by their stamps.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from deeptruck_core.arrays import Array
from deeptruck_core.errors import InputError
from deeptruck_model.checks import Clock

Index = NDArray[np.int64]

REORDER_NS = 1_000_000_000  # messages may overtake each other by this much; further back is a clock set back
MOST_S = 0.5  # that the stamps of two topics may differ by, at the same log time
_SIMULATED_NS = 10**17  # stamps before 1973 are no dates
_LOG_RUNS = 0.1  # of the stamps' own span: messages logged in less were not logged as they came


class TopicClock:
    """The first stamp and log time of a topic's messages in each second of log time."""

    def __init__(self) -> None:
        self.stamped = False
        self._log_ns: list[Index] = []
        self._stamps: list[Index] = []

    def put(self, stamps: Index, log_ns: Index, stamped: bool) -> None:
        """Add messages as logged: stamps and log times (n,) in ns; without headers both are the same."""
        seconds = log_ns // 1_000_000_000
        first = np.flatnonzero(np.diff(seconds, prepend=seconds[0] - 1))
        self._log_ns.append(log_ns[first])
        self._stamps.append(stamps[first])
        self.stamped = stamped

    def times(self) -> tuple[Index, Index]:
        """Log times, ascending, and the stamps at these times, in ns (n,)."""
        log_ns, stamps = np.concatenate(self._log_ns), np.concatenate(self._stamps)
        order = np.argsort(log_ns, kind="stable")
        return log_ns[order], stamps[order]


class Clocks:
    """Gives the messages of each topic their times: by `clock` if given, else by stamps if there are any."""

    def __init__(self, clock: Clock | None = None, *, mixed: bool = False) -> None:
        self.clock, self._mixed = clock, mixed
        self._topics: dict[str, TopicClock] = {}

    def timed(self, topic: str, stamps: Index, log_ns: Index, stamped: bool) -> Index:
        """The times (n,) in ns of messages as logged, from their stamps and log times. Of a topic without
        stamps the log times are passed as stamps."""
        self._topics.setdefault(topic, TopicClock()).put(stamps, log_ns, stamped)
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
        times = {topic: clock.times() for topic, clock in self._topics.items()}
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


@dataclass(frozen=True)
class Part:
    """Samples in the order of their stamps: stamps (n,) in ns, columns each (n,); and the stamps of messages
    omitted because a later message has the same stamp."""

    stamps: Index
    columns: list[Array]
    doubled: Index


class Queue:
    """Sorts stamped samples as they arrive; of equal stamps the last is used."""

    def __init__(self, topic: str, path: Path) -> None:
        self.topic, self.path = topic, path
        self.waiting = 0
        self._parts: list[tuple[Index, list[Array]]] = []
        self._latest = -(2**63)
        self._count = self._swapped = 0

    def put(self, stamps: Index, columns: list[Array]) -> None:
        """Add samples as logged: stamps (n,) in ns, columns each (n,). Raises InputError if time goes
        back."""
        latest = np.maximum.accumulate(np.maximum(stamps, self._latest))
        back = latest - stamps
        if int(back.max()) > REORDER_NS:
            at = int(np.argmax(back > REORDER_NS))
            raise InputError(
                f"{self.path}: time goes back by {back[at] / 1e9:.3g} s on {self.topic} "
                f"(message {self._count + at}): its clock was set back, a stamp is wrong, or the bag holds "
                "two runs; '--clock log' times the messages by when they were recorded"
            )
        self._swapped += int((back > 0).sum())
        self._latest = int(latest[-1])
        self._count += len(stamps)
        self.waiting += len(stamps)
        self._parts.append((stamps, columns))

    def take(self, until: int | None) -> Part:
        """Sorted samples stamped before `until` (None: all), which must lie REORDER_NS in the past."""
        if not self._parts:
            return Part(np.zeros(0, np.int64), [], np.zeros(0, np.int64))
        stamps = np.concatenate([s for s, _ in self._parts])
        columns = [np.concatenate(c) for c in zip(*(c for _, c in self._parts), strict=True)]
        order = np.argsort(stamps, kind="stable")
        stop = len(order) if until is None else int(np.searchsorted(stamps[order], until))
        now, later = order[:stop], order[stop:]
        unique = np.append(np.diff(stamps[now]) > 0, True)[: len(now)]
        doubled, now = stamps[now[~unique]], now[unique]
        self._parts = [(stamps[later], [c[later] for c in columns])] if len(later) else []
        self.waiting = len(later)
        return Part(stamps[now], [c[now] for c in columns], doubled)

    def notes(self) -> list[str]:
        """The corrections that were made."""
        return [f"{self._swapped} messages on {self.topic} put back in order"] if self._swapped else []
