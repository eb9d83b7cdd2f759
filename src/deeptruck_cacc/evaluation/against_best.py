"""Compares a policy with the best baseline, scene by scene, with intervals over rollouts and seeds.

The error of a rollout is its worst time-gap error after 10 s, over times at which the engine could have kept
the gap; that of a scene is the mean over rollouts. The best baseline has the fewest crashes, then the least
error. It is selected on the rollouts on which it is compared, which favours it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from deeptruck_cacc.evaluation.metrics import EACH
from deeptruck_core.arrays import Array

DRAWS = 2000  # of the bootstrap
LEVEL = 0.95


def against_best(results: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """By scene: mean error (s) and crashes of the policy and of the best baseline, and the mean difference,
    s, with its interval. Scenes that no baseline drove, or in which the gap could not be kept, are omitted.
    """
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
    """Bootstrap interval of LEVEL for the mean of differences (seeds, rollouts); both dimensions are
    resampled."""
    rng, (seeds, rollouts) = np.random.default_rng(0), differences.shape
    row = rng.integers(seeds, size=(DRAWS, seeds, 1))
    column = rng.integers(rollouts, size=(DRAWS, 1, rollouts))
    means = differences[row, column].mean(axis=(1, 2))
    low, high = np.quantile(means, [(1 - LEVEL) / 2, (1 + LEVEL) / 2])
    return float(low), float(high)
