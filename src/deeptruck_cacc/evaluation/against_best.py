"""A policy against the best of the baselines, scene by scene, with an interval over rollouts and seeds.

What counts in a rollout is its worst time-gap error after 10 s where the engine could have held the gap; in a
scene their mean. The best baseline has the fewest crashes, then the least error. It is chosen on the rollouts
on which it is compared, which favours it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from deeptruck_cacc.evaluation.metrics import EACH

Array = NDArray[np.float64]

DRAWS = 2000  # of the bootstrap
LEVEL = 0.95


def against_best(results: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """By scene: policy and best baseline, each mean error (s) and crashes, and the mean difference, s, with
    the ends of its interval. Scenes that no baseline drove, or nobody could hold, are not in it."""
    out: dict[str, dict[str, Any]] = {}
    for name, row in results["sets"].items():
        rows = {law: sets[name] for law, sets in results["baselines"].items() if EACH in sets.get(name, {})}
        if EACH not in row or not rows:
            continue
        best = min(rows, key=lambda law: (rows[law]["crashes"], np.mean(rows[law][EACH])))
        ours, theirs = np.atleast_2d(row[EACH]), np.array(rows[best][EACH])
        low, high = interval(ours - theirs)
        out[name] = {
            "policy_s": float(ours.mean()),
            "policy_crashes": row["crashes"],
            "best": best,
            "best_s": float(theirs.mean()),
            "best_crashes": rows[best]["crashes"],
            "difference_s": float((ours - theirs).mean()),
            "low_s": low,
            "high_s": high,
        }
    return out


def interval(differences: Array) -> tuple[float, float]:
    """Bootstrap interval of LEVEL for the mean of differences (seeds, rollouts); both are drawn anew."""
    rng, (seeds, rollouts) = np.random.default_rng(0), differences.shape
    row = rng.integers(seeds, size=(DRAWS, seeds, 1))
    column = rng.integers(rollouts, size=(DRAWS, 1, rollouts))
    means = differences[row, column].mean(axis=(1, 2))
    low, high = np.quantile(means, [(1 - LEVEL) / 2, (1 + LEVEL) / 2])
    return float(low), float(high)
