"""Buffer of a truck's messages of the last minutes."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from copy import copy

import numpy as np

from deeptruck_model.recordings.clocks import REORDER_NS
from deeptruck_model.recordings.resample import Received


class Window:
    """The newest messages of each topic, of up to `seconds` of stamps and at most `most_hz` per second."""

    def __init__(self, seconds: float, most_hz: float) -> None:
        self._span, self._least = round(seconds * 1e9), round(1e9 / most_hz)
        self._topics: dict[str, deque[tuple[int, Mapping[str, float]]]] = {}
        self._newest = 0

    def hear(self, topic: str, stamp: int, values: Mapping[str, float]) -> None:
        """Add a message stamped at `stamp`, ns, with its numbers by field. If the clock is set back, as in a
        replay that is moved, the window is cleared; of equal stamps the last is used."""
        before = self._topics.get(topic)
        if before and stamp < before[-1][0] - REORDER_NS:
            self._topics.clear()
            self._newest = stamp
        self._newest = max(self._newest, stamp)
        kept = self._topics.setdefault(topic, deque())
        if kept and kept[-1][0] == stamp:
            kept.pop()
        elif kept and abs(stamp - kept[-1][0]) < self._least:
            return
        kept.append((stamp, values))
        while kept and kept[0][0] < self._newest - self._span:
            kept.popleft()

    def copy(self) -> Window:
        """A copy of the present content, which can be converted to columns while more messages arrive."""
        other = copy(self)
        other._topics = {topic: kept.copy() for topic, kept in self._topics.items()}
        return other

    def heard(self) -> dict[str, Received]:
        """All messages by topic, in columns."""
        out = {}
        for topic, kept in self._topics.items():
            stamps = np.array([stamp for stamp, _ in kept], np.int64)
            fields = dict.fromkeys(field for _, values in kept for field in values)
            columns = {f: np.array([values.get(f, np.nan) for _, values in kept], float) for f in fields}
            out[topic] = Received(stamps, columns)
        return out
