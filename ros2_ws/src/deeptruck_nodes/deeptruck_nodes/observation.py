"""What the controller knows: the newest consistent radar and truck samples."""

from __future__ import annotations

import math
from dataclasses import dataclass

SECOND = 1_000_000_000  # ns


@dataclass(frozen=True)
class Observation:
    """One sample in SI units; gap and leader speed are NaN where the radar detected nothing."""

    stamp: int
    speed: float
    gap: float
    leader_speed: float
    grade: float


class Alignment:
    """Collects samples by their stamps.

    A radar sample is complete when range and speed carry the same stamp. In lock-step (`strict`) the truck's
    speed, and its grade where it has one, must carry that stamp too; in real time the newest ones count, and
    a radar sample that is older than the newest speed by more than `stale_after_s` is none.
    """

    def __init__(self, strict: bool, uses_grade: bool, stale_after_s: float) -> None:
        self._strict, self._uses_grade = strict, uses_grade
        self._oldest = round(stale_after_s * SECOND)
        self._latest: dict[str, tuple[int, float]] = {}
        self._taken = -1

    def put(self, name: str, stamp: int, value: float) -> Observation | None:
        """File a speed, gap, leader_speed or grade. Returns the observation it completes, once each."""
        self._latest[name] = (stamp, value)
        if not {"speed", "gap", "leader_speed"} <= self._latest.keys():
            return None
        stamp, gap = self._latest["gap"]
        needed = ["leader_speed"]
        if self._strict:
            needed += ["speed", "grade"] if self._uses_grade else ["speed"]
        if stamp <= self._taken or any(self._latest.get(n, (-1,))[0] != stamp for n in needed):
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
        return Observation(stamp, speed, gap, leader_speed, grade if math.isfinite(grade) else 0.0)
