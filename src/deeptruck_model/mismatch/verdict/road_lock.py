"""Tests whether a slow force depends on the road position, without GPS: another pass over the same road then
repeats it.

A window of the force along the road is compared with all other driving: as it is for a pass in the same
direction, and reversed with the opposite sign for a pass in the other direction, as for slopes. Chance
agreement is estimated from the two comparisons that no road can cause: same direction with the opposite sign,
and reversed with the same sign.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.rules import Limits

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

STEP_M, LENGTH_M = 100.0, 6000.0  # a shorter window of a smooth profile is like many others
WIDTH = int(LENGTH_M / STEP_M)
EVERY = 8  # steps between the windows that are sought again


@dataclass(frozen=True)
class RoadLock:
    """Distance (km) over which the force was repeated by a pass in the same and in the other direction."""

    same_way_km: float
    other_way_km: float


def road_lock(e: Evidence, force: Array) -> RoadLock | None:
    """Where a slow specific force (n,) was repeated; None if no road was driven twice."""
    windows = _windows(e, force)
    picked = np.arange(0, len(windows.at), EVERY)
    if len(picked) < Limits.road_windows / Limits.road_share:
        return None
    all_of_them = windows.centred()
    a = all_of_them[picked]

    def agreement(sought: Array) -> Array:
        """How well each agrees with the most similar window elsewhere."""
        return np.asarray(_elsewhere(windows, picked, similarity(sought, all_of_them)).max(axis=1))

    same, other = agreement(a), agreement(turned(a))
    chance = np.concatenate([agreement(-a), agreement(-turned(a))])
    limit = float(np.quantile(chance, Limits.by_chance))
    same_km, other_km = _beyond_chance(same > limit), _beyond_chance(other > limit)
    return RoadLock(same_km, other_km) if same_km or other_km else None


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


@dataclass(frozen=True)
class Windows:
    """Windows of profiles (m, WIDTH), the index of each one's profile, and where it begins there (m)."""

    values: Array
    profile: Indices
    at: Array

    @staticmethod
    def of(profiles: Sequence[tuple[Array, Array]]) -> Windows:
        """Every window of LENGTH_M along profiles of (distance, value), STEP_M apart."""
        parts, which, at = [np.zeros((0, WIDTH))], [np.zeros(0, dtype=np.intp)], [np.zeros(0)]
        for i, (distance, value) in enumerate(profiles):
            grid = steps(distance)
            if len(grid) < WIDTH:
                continue
            made = np.lib.stride_tricks.sliding_window_view(np.interp(grid, distance, value), WIDTH)
            parts.append(made)
            which.append(np.full(len(made), i))
            at.append(grid[: len(made)])
        return Windows(np.concatenate(parts), np.concatenate(which), np.concatenate(at))

    def centred(self) -> Array:
        """The windows minus their means, which sensors and loads change between recordings."""
        out: Array = self.values - self.values.mean(axis=1, keepdims=True)
        return out


def steps(distance: Array) -> Array:
    """Positions STEP_M apart over a distance (n,), m."""
    return np.arange(distance[0], distance[-1], STEP_M) if len(distance) else np.zeros(0)


def turned(windows: Array) -> Array:
    """Windows (m, k) of slopes as seen in the opposite driving direction."""
    return -windows[:, ::-1]


def similarity(sought: Array, among: Array) -> Array:
    """Agreement of windows (a, k) with others (b, k), both without means, (a, b): 1 if equal, 0 if unrelated;
    size counts too."""
    size = np.sum(sought**2, axis=1)[:, None] + np.sum(among**2, axis=1)[None]
    out: Array = 2.0 * (sought @ among.T) / (size + 1e-12)
    return out
