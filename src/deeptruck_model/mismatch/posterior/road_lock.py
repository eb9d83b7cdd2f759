"""Whether a slow force belongs to the road: it comes again where the same stretch is driven again.

Stretches are found by the force itself, without GPS: a window of the force along the distance is laid over
all other driving, as it is for a pass the same way, and turned round with the other sign for a pass the other
way, as only a slope does that. How well windows agree by chance is seen from the two comparisons that no road
can cause: the same way with the other sign, and turned round with the same sign.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.rules import Rules

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

STEP_M, LENGTH_M = 100.0, 6000.0  # a shorter window of a smooth force is like many others
EVERY = 8  # steps between the windows that are sought again


@dataclass(frozen=True)
class RoadLock:
    """Distance (km) over which the force came again on a pass the same way and the other way, how well
    it agreed there, and how well 99 % of windows agree at most by chance."""

    same_way_km: float
    other_way_km: float
    agreement: float
    by_chance: float


@dataclass(frozen=True)
class Windows:
    """Windows of the force (m, k) without their means, the recording of each, and where it begins (m)."""

    force: Array
    record: Indices
    at: Array

    @staticmethod
    def of(e: Evidence, force: Array) -> Windows:
        """Every window of LENGTH_M along each recording, STEP_M apart."""
        width = int(LENGTH_M / STEP_M)
        parts, record, at = [], [], []
        for i, s in enumerate(e.stretches):
            along, known = e["distance"][s.rows], e.valid[s.rows]
            grid = np.arange(along[0], along[-1], STEP_M)
            if len(grid) < width or not known.any():
                continue
            profile = np.interp(grid, along[known], force[s.rows][known])
            made = np.lib.stride_tricks.sliding_window_view(profile, width)
            parts.append(made - made.mean(axis=1, keepdims=True))
            record.append(np.full(len(made), i))
            at.append(grid[: len(made)])
        if not parts:
            return Windows(np.zeros((0, width)), np.zeros(0, dtype=np.intp), np.zeros(0))
        return Windows(np.concatenate(parts), np.concatenate(record), np.concatenate(at))


def road_lock(e: Evidence, force: Array) -> RoadLock | None:
    """Where a slow specific force (n,) came again; None where no road was seen twice."""
    windows = Windows.of(e, force)
    picked = np.arange(0, len(windows.at), EVERY)
    if len(picked) < e.rules.road_windows / e.rules.road_share:
        return None
    a = windows.force[picked]
    same, other = _best(windows, picked, a), _best(windows, picked, -a[:, ::-1])
    chance = np.concatenate([_best(windows, picked, -a), _best(windows, picked, a[:, ::-1])])
    limit = float(np.quantile(chance, e.rules.road_by_chance))
    same_km, other_km = _beyond_chance(same > limit, e.rules), _beyond_chance(other > limit, e.rules)
    if not same_km and not other_km:
        return None
    again = np.maximum(same if same_km else -1.0, other if other_km else -1.0)
    return RoadLock(same_km, other_km, float(np.median(again[again > limit])), limit)


def _beyond_chance(found: NDArray[np.bool_], rules: Rules) -> float:
    """Kilometres of the windows that were found again, 0 where they are so few that chance alone finds
    them."""
    km = round(EVERY * STEP_M / 1000.0 * int(found.sum()), 1)
    enough = found.mean() >= rules.road_share and km >= rules.road_windows * LENGTH_M / 1000.0
    return km if enough else 0.0


def _best(windows: Windows, picked: Indices, force: Array) -> Array:
    """How well each of the windows `force` (m, k) agrees with the most alike elsewhere: 1 for the same, 0 for
    no likeness."""
    size = np.sum(windows.force**2, axis=1)
    alike = 2.0 * (force @ windows.force.T) / (np.sum(force**2, axis=1)[:, None] + size[None] + 1e-12)
    for row, i in enumerate(picked):
        here = (windows.record == windows.record[i]) & (np.abs(windows.at - windows.at[i]) < LENGTH_M)
        alike[row, here] = -1.0
    best: Array = alike.max(axis=1)
    return best
