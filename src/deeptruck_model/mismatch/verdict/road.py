"""Identifies an unrecorded road: a slow force that depends on the road position.

A learned truck that gets its own speed follows a slope as it follows every slow force, so that little of it
remains in its residual. A linear model of the recordings does not (`slow_force.plain_truck`). Its residual is
smoothed in time; if a window of the slow part is repeated elsewhere, with the same sign in the same direction
or the opposite sign in the opposite direction, it belongs to the road. If none is repeated, the size that
each possible cause would need decides.

Chance agreement is estimated from the two comparisons that no road can cause: same direction with the
opposite sign, and reversed with the same sign.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import gammainc

from deeptruck_core.arrays import Array, Indices, Mask
from deeptruck_core.signals import FELT
from deeptruck_core.vehicle_kinds import LARGEST_DERATE, STEEPEST, STRONGEST_WIND
from deeptruck_model.mismatch.mechanisms.families import UNKNOWN
from deeptruck_model.mismatch.posterior.names import Named, Tree
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.rules import Limits
from deeptruck_model.mismatch.verdict.slow_force import plain_truck, slow_force

SLOPE, SURFACE = "road_grade", "road_surface"
LARGEST = {SLOPE: STEEPEST, "headwind": STRONGEST_WIND, "torque_derate": LARGEST_DERATE}  # rms
OTHER = 0.05  # weight of a slow force that is none of these
ONE_WAY = 0.5  # probability of a slope where the road was driven again the same way alone


@dataclass(frozen=True)
class Road:
    """The slow force (n,), m/s^2, the passes that repeat it (None: no pass), and the probability of names."""

    force: Array
    lock: RoadLock | None
    tree: Tree

    def named(self) -> Named:
        """The road as a `Named`, since no kernel of the simulator's residual contains it."""
        return Named(self.tree.first, self.tree, 0.0, self.force)


def road(e: Evidence) -> Road | None:
    """The road, for a learned simulator without a recorded slope; None if no force is slow."""
    if e.known_physics or e.has("grade") or e.has(FELT):
        return None
    line = plain_truck(e)
    if line is None:
        return None
    known = np.isfinite(line.left)
    sigma = float(1.4826 * np.median(np.abs(line.left[known])))
    slow = slow_force(e, np.where(known, line.left, 0.0), known.astype(float), sigma, line.doubt)
    if slow is None:
        return None
    lock = road_lock(e, slow.force)
    return Road(slow.force, lock, _by_size(slow.needed) if lock is None else _tree(e, lock))


def _by_size(needed: Mapping[str, float]) -> Tree:
    """Probabilities of names from the size that each would need relative to the largest possible one, two
    standard deviations."""
    weight = {n: float(np.exp(-0.5 * (2.0 * size / LARGEST[n]) ** 2)) for n, size in needed.items()}
    weight[UNKNOWN] = OTHER
    total = sum(weight.values())
    return Tree({name: w / total for name, w in weight.items()})


def _tree(e: Evidence, lock: RoadLock) -> Tree:
    """Probabilities of names from the number of windows that agree with another pass better than 99 % do by
    chance. Either direction may agree by chance, and a road has the prior probability one half."""
    beside = sum(float(np.ptp(e["distance"][s.rows])) // LENGTH_M for s in e.drives)
    again = max(lock.same_way_km, lock.other_way_km) * 1000.0 / LENGTH_M
    by_chance = min(2.0 * float(gammainc(again, (1.0 - Limits.by_chance) * max(beside, 1.0))), 1.0)  # Poisson
    p = 1.0 / (1.0 + by_chance)
    slope = 1.0 if lock.other_way_km else ONE_WAY  # a surface slows either way
    return Tree({SLOPE: p * slope, SURFACE: p * (1.0 - slope), UNKNOWN: 1.0 - p})


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


def _beyond_chance(found: Mask) -> float:
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
