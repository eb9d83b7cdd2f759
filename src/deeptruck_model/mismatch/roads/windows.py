"""Finds roads that were driven again by the slope or slow force along them, without GPS.

A window of the profile is compared with all other driving: as it is for a pass in the same direction, and
reversed with the opposite sign for a pass in the other direction, as for slopes. Chance agreement is
estimated from the two comparisons that no road can cause: same direction with the opposite sign, and reversed
with the same sign.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

STEP_M, LENGTH_M = 100.0, 6000.0  # a shorter window of a smooth profile is like many others
WIDTH = int(LENGTH_M / STEP_M)


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
