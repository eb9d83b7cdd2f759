"""Compares several sides with the first one; content of compare.json."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from deeptruck_core.errors import InputError
from deeptruck_model.checks import Clock, calls
from deeptruck_model.compare import sides, statistics
from deeptruck_model.compare.alignment import By, Offset, Road, offset, road
from deeptruck_model.compare.sides import Side
from deeptruck_model.compare.statistics import Difference, Statistics

SCHEMA = 1
STEP_S = 0.5


@dataclass(frozen=True)
class Compared:
    """A side with its offset from the first one (s), and the road they share or the reason why they share
    none."""

    side: Side
    offset: Offset
    road: Road | str
    statistics: Statistics
    difference: Difference | None  # None of the first, and where there is no time together


@dataclass(frozen=True)
class Comparison:
    """The first side, and the others compared with it."""

    compared: tuple[Compared, ...]

    def to_json(self) -> dict[str, Any]:
        """Content of compare.json."""
        return {"schema": SCHEMA, "sides": [_to_dict(c) for c in self.compared]}


def compare(
    texts: Sequence[str],
    *,
    given: Mapping[str, float] | None = None,
    topic_map: Path | None = None,
    clock: Clock | None = None,
    msg: Sequence[Path] = (),
) -> Comparison:
    """Compare bags, or simulators along bags ('SIM@BAG'), with the first of them.

    `given` are offsets in s by the names of sides, used instead of estimated ones. Raises InputError as
    `recordings.read` does, and for an unknown name.
    """
    if isinstance(texts, str) or not isinstance(texts, Sequence) or len(texts) < 2:
        raise InputError(
            f"give two sides or more to compare, as a list of bags or 'SIM@BAG', not {calls.shown(texts)}"
        )
    if twice := [text for text in texts if texts.count(text) > 1]:
        raise InputError(f"{twice[0]} is given twice; give each side once")
    loaded = sides.load(texts, STEP_S, topic_map, clock, msg)
    unknown = set(given or ()) - {s.name for s in loaded[1:]}
    if unknown:
        names = ", ".join(s.name for s in loaded[1:])
        raise InputError(
            f"--offset-s: there is no side {', '.join(sorted(unknown))} to move; there are {names}"
        )
    first = loaded[0]
    whole = Road(first.distance, "itself", float(first.distance[-1]))
    own = Compared(first, Offset(0.0, 1.0, By.ONE_BAG), whole, statistics.of(first), None)
    return Comparison((own, *(_beside(first, s, given or {}) for s in loaded[1:])))


def _beside(first: Side, side: Side, given: Mapping[str, float]) -> Compared:
    if side.bag == first.bag:  # a simulator along it
        found = Offset(0.0, _correlation(first, side, 0.0), By.ONE_BAG)
    else:
        found = offset(first, side)
    if side.name in given:
        found = Offset(given[side.name], _correlation(first, side, given[side.name]), By.GIVEN)
    difference = statistics.difference(first, side, found.seconds)
    return Compared(side, found, road(first, side), statistics.of(side), difference)


def _correlation(first: Side, side: Side, offset_s: float) -> float:
    moved = offset_s + side.step_s * np.arange(len(side))
    time = first.step_s * np.arange(len(first))
    there = np.interp(time, moved, side.columns["speed"], left=np.nan, right=np.nan)
    known = np.isfinite(there) & np.isfinite(first.columns["speed"])
    if known.sum() < 3 or np.std(there[known]) * np.std(first.columns["speed"][known]) == 0.0:
        return 0.0
    return float(np.corrcoef(there[known], first.columns["speed"][known])[0, 1])


def _to_dict(c: Compared) -> dict[str, Any]:
    shared = c.road if isinstance(c.road, Road) else None
    return {
        "name": c.side.name,
        "simulator": c.side.simulated or None,
        "offset_s": c.offset.seconds,
        "speed_correlation": c.offset.correlation,
        "offset_found": c.offset.found,
        "offset_by": c.offset.by,
        "shared_road_m": shared.shared_m if shared else 0.0,
        "road_known_by": shared.by if shared else str(c.road),
        "statistics": asdict(c.statistics),
        "difference": asdict(c.difference) if c.difference else None,
    }
