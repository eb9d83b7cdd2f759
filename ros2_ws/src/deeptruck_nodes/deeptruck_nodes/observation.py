"""Combines the newest consistent radar and truck samples into observations for the controller."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass

SECOND = 1_000_000_000  # ns
STREAMS = {"speed": "truck speed", "gap": "radar range", "leader_speed": "radar speed"}


@dataclass(frozen=True)
class Observation:
    """One sample in SI units; gap and leader speed are NaN if the radar detected nothing."""

    stamp: int
    speed: float
    gap: float
    leader_speed: float
    grade: float


class StampClock:
    """Checks the stamps of one stream against the times of reception. All times in ns.

    A stamp must not be older than the last one, nor further ahead of its reception than any before it,
    within `tolerance`. A single message that is gets refused. If the next one agrees with it instead of
    with those before, the sender's clock was set, and the checks begin anew from there.
    """

    def __init__(self, tolerance: int) -> None:
        self._tolerance = tolerance
        self._last: int | None = None  # stamp
        self._ahead = 0  # largest difference of stamp and reception, that of the least delay
        self._refused: tuple[int, int] | None = None  # stamp and difference of the last message if refused

    def take(self, stamp: int, received: int) -> str:
        """Why a message is refused, 'set' if it shows that the clock was set, else ''."""
        ahead = stamp - received
        if self._last is None or (self._last <= stamp and ahead <= self._ahead + self._tolerance):
            self._ahead = ahead if self._last is None else max(ahead, self._ahead)
            self._last, self._refused = stamp, None
            return ""
        before, self._refused = self._refused, (stamp, ahead)
        if before is not None and before[0] < stamp and abs(ahead - before[1]) <= self._tolerance:
            self._last, self._ahead, self._refused = stamp, ahead, None
            return "set"
        return "stamped in the past" if stamp < self._last else "stamped in the future"


class Alignment:
    """Combines samples by their stamps.

    A radar sample is complete when range and speed have the same stamp. In lock-step (`strict`) the truck's
    speed and engaged bit, and, if available, its grade, must have that stamp too. In real time the newest
    ones are used. A radar sample whose stamp differs from that of the newest speed by more than
    `stale_after_s` is discarded. Messages of radar and truck with false stamps are refused (`StampClock`).

    `refused` counts what was discarded, and clocks that were set, by reason.
    """

    def __init__(self, strict: bool, uses_grade: bool, stale_after_s: float) -> None:
        self._needed = ["leader_speed"]
        if strict:
            self._needed += ["speed", "engaged", *["grade"] * uses_grade]
        self._oldest = round(stale_after_s * SECOND)
        self._latest: dict[str, tuple[int, float]] = {}
        self._taken = -1
        self._clocks = {} if strict else {name: StampClock(self._oldest) for name in STREAMS}
        self.refused: Counter[str] = Counter()

    def put(self, name: str, stamp: int, value: float, received: int = 0) -> Observation | None:
        """Add speed, gap, leader_speed, grade or engaged. Returns the observation that it completes, each
        only once. `received` is the time of reception by a clock that is never set, ns; unused in
        lock-step."""
        if name in self._clocks and (said := self._clocks[name].take(stamp, received)):
            who = STREAMS[name]
            self.refused[f"the clock of the {who} was set" if said == "set" else f"{who} {said}"] += 1
            if said != "set":
                return None
        self._latest[name] = (stamp, value)
        return self._complete()

    def unseen(self, stamp: int) -> Observation | None:
        """What is known at a stamp at which the radar is silent: no vehicle is seen; None before a speed."""
        return None if "speed" not in self._latest else self._observe(stamp, math.nan)

    def _complete(self) -> Observation | None:
        if not {"speed", "gap", "leader_speed"} <= self._latest.keys():
            return None
        stamp, gap = self._latest["gap"]
        if stamp == self._taken or any(self._latest.get(n, (-1,))[0] != stamp for n in self._needed):
            return None
        self._taken = stamp
        apart = stamp - self._latest["speed"][0]
        if self._clocks and abs(apart) > self._oldest:
            self.refused[f"radar {'older' if apart < 0 else 'newer'} than the truck speed"] += 1
            return None
        return self._observe(stamp, gap)

    def _observe(self, stamp: int, gap: float) -> Observation:
        speed, leader_speed = self._latest["speed"][1], self._latest.get("leader_speed", (0, math.nan))[1]
        grade = self._latest.get("grade", (0, 0.0))[1]
        if not (math.isfinite(gap) and math.isfinite(leader_speed)):
            gap = leader_speed = math.nan
        return Observation(stamp, speed, gap, leader_speed, grade if math.isfinite(grade) else 0.0)
