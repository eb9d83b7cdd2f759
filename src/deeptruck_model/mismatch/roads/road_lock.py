"""Tests whether a slow force depends on the road position: another pass over the same road then
repeats it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.roads.next_pass import NextPass, next_pass
from deeptruck_model.mismatch.roads.windows import LENGTH_M, STEP_M, Windows, similarity, turned
from deeptruck_model.mismatch.rules import Limits

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

EVERY = 8  # steps between the windows that are sought again


@dataclass(frozen=True)
class RoadLock:
    """Distance (km) over which the force was repeated by a pass in the same and in the other direction."""

    same_way_km: float
    other_way_km: float
    ahead: NextPass | None = None  # what the other pass predicts of the road beyond


def road_lock(e: Evidence, force: Array) -> RoadLock | None:
    """Where a slow specific force (n,) was repeated; None if no road was driven twice."""
    windows = _windows(e, force)
    picked = np.arange(0, len(windows.at), EVERY)
    if len(picked) < Limits.road_windows / Limits.road_share:
        return None
    all_of_them = windows.centred()
    a = all_of_them[picked]

    def found(sought: Array) -> tuple[Array, Indices]:
        """How well each agrees with the most alike elsewhere, and which that is."""
        alike = _elsewhere(windows, picked, similarity(sought, all_of_them))
        return alike.max(axis=1), alike.argmax(axis=1)

    (same, there), (other, back) = found(a), found(turned(a))
    chance = np.concatenate([found(-a)[0], found(-turned(a))[0]])
    limit = float(np.quantile(chance, Limits.by_chance))
    same_km, other_km = _beyond_chance(same > limit), _beyond_chance(other > limit)
    if not same_km and not other_km:
        return None
    again = np.maximum(same if same_km else -1.0, other if other_km else -1.0)
    on = again > limit
    reverse = (again == other) & (other_km > 0.0)
    ahead = next_pass(windows, picked[on], np.where(reverse, back, there)[on], reverse[on])
    return RoadLock(same_km, other_km, ahead)


def _beyond_chance(found: NDArray[np.bool_]) -> float:
    """Kilometres of the repeated windows; 0 if there are no more than chance would give."""
    km = round(EVERY * STEP_M / 1000.0 * int(found.sum()), 1)
    enough = found.mean() >= Limits.road_share and km >= Limits.road_windows * LENGTH_M / 1000.0
    return km if enough else 0.0


def _windows(e: Evidence, force: Array) -> Windows:
    """The windows along each recording, over valid rows."""
    profiles = []
    for s in e.drives:
        along, known = e["distance"][s.rows], e.valid[s.rows]
        if known.any():
            ends = [along[0], *along[known], along[-1]]
            value = force[s.rows][known]
            profiles.append((np.array(ends), np.array([value[0], *value, value[-1]])))
    return Windows.of(profiles)


def _elsewhere(windows: Windows, picked: Indices, alike: Array) -> Array:
    """The similarity (p, m) of `picked` windows with all windows that do not overlap them."""
    for row, i in enumerate(picked):
        here = (windows.profile == windows.profile[i]) & (np.abs(windows.at - windows.at[i]) < LENGTH_M)
        alike[row, here] = -1.0
    return alike
