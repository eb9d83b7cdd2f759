"""Identifies an unrecorded road: a slow force that depends on the road position.

A learned truck that gets its own speed follows a slope as it follows every slow force, so that little of it
remains in its residual. A linear model of the recordings does not (`slow_force.plain_truck`). Its residual
is smoothed in time; if a window of the slow part is repeated elsewhere, with the same sign in the same
direction or the opposite sign in the opposite direction, it belongs to the road. If none is repeated, the
size that each possible cause would need decides.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammainc

from deeptruck_core.signals import FELT
from deeptruck_core.vehicle_kinds import LARGEST_DERATE, STEEPEST, STRONGEST_WIND
from deeptruck_model.mismatch.mechanisms.families import UNKNOWN
from deeptruck_model.mismatch.posterior.names import Named, Tree
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.rules import Limits
from deeptruck_model.mismatch.verdict.road_lock import LENGTH_M, RoadLock, road_lock
from deeptruck_model.mismatch.verdict.slow_force import plain_truck, slow_force

Array = NDArray[np.float64]

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
