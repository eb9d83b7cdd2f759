"""Combines the newest consistent radar and truck samples into observations for the controller."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

SECOND = 1_000_000_000  # ns
MAP_AGE = SECOND  # ns


@dataclass(frozen=True)
class Observation:
    """One sample in SI units; gap and leader speed are NaN if the radar detected nothing. `grade_ahead` has
    the format of a Policy's observation, () if it is not known."""

    stamp: int
    speed: float
    gap: float
    leader_speed: float
    grade: float
    grade_ahead: tuple[float, ...] = ()


class Alignment:
    """Combines samples by their stamps.

    A radar sample is complete when range and speed have the same stamp. In lock-step (`strict`) the truck's
    speed and engaged bit, and, if available, its grade and road map, must have that stamp too. In real time
    the newest ones are used; a radar sample older than the newest speed by more than `stale_after_s` is
    discarded, and so is a map older than a sample by more than MAP_AGE, because the truck has moved on.
    """

    def __init__(self, strict: bool, uses_grade: bool, stale_after_s: float, uses_map: bool = False) -> None:
        self._needed = ["leader_speed"]
        if strict:
            self._needed += ["speed", "engaged", *["grade"] * uses_grade, *["grade_ahead"] * uses_map]
        self._oldest = round(stale_after_s * SECOND)
        self._latest: dict[str, tuple[int, float]] = {}
        self._map: tuple[float, ...] = ()
        self._taken = -1

    def put(self, name: str, stamp: int, value: float) -> Observation | None:
        """Add speed, gap, leader_speed, grade or engaged. Returns the observation that it completes, each
        only once."""
        self._latest[name] = (stamp, value)
        return self._complete()

    def put_map(self, stamp: int, grades: Sequence[float]) -> Observation | None:
        """Add the known grades of the road ahead. Returns the observation that they complete, each
        only once."""
        self._latest["grade_ahead"], self._map = (stamp, 0.0), tuple(grades)
        return self._complete()

    def _complete(self) -> Observation | None:
        if not {"speed", "gap", "leader_speed"} <= self._latest.keys():
            return None
        stamp, gap = self._latest["gap"]
        if stamp <= self._taken or any(self._latest.get(n, (-1,))[0] != stamp for n in self._needed):
            return None
        if stamp < self._latest["speed"][0] - self._oldest:
            return None
        self._taken = stamp
        return self._observe(stamp, gap)

    def _observe(self, stamp: int, gap: float) -> Observation:
        speed, leader_speed = self._latest["speed"][1], self._latest["leader_speed"][1]
        grade = self._latest.get("grade", (0, 0.0))[1]
        if not (math.isfinite(gap) and math.isfinite(leader_speed)):
            gap = leader_speed = math.nan
        known = abs(stamp - self._latest.get("grade_ahead", (stamp, 0.0))[0]) <= MAP_AGE
        grade = grade if math.isfinite(grade) else 0.0
        return Observation(stamp, speed, gap, leader_speed, grade, self._map if known else ())
