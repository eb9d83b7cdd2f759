"""Sorts the samples of one topic by their stamps."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from deeptruck_model.errors import InputError

Array = NDArray[np.float64]
Index = NDArray[np.int64]

REORDER_NS = 1_000_000_000  # messages may overtake each other by this much; further back is a clock set back


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
