"""Coverage of a deep truck: a histogram of its training data, and the samples it learned from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from deeptruck_core.arrays import Array
from deeptruck_core.signals import ACCELERATION, SPEED
from deeptruck_model.recordings import Recording

SPEED_BIN, ACCELERATION_BIN, GRADE_BIN = 2.0, 0.5, 0.01  # m/s, m/s^2, ratio
Rows = NDArray[Any]
PER_S, MOST = 1.0, 50_000  # samples a second that are kept, and of all
SPEED_NEAR, GRADE_NEAR, COMMAND_NEAR = 2.0, 0.01, 0.1  # m/s, ratio, and of the command's range: alike
LEAST_S = 2.0  # of driving alike that teach


@dataclass(frozen=True)
class Coverage:
    """Counts (speed, acceleration, grade) from the lowest corner `low`; a bin is `size` wide."""

    low: tuple[float, float, float]
    size: tuple[float, float, float]
    counts: NDArray[np.int64]

    def covers(self, y: Array, w: Array) -> NDArray[np.bool_]:
        """True if the bin of a sample, or an adjacent one, has training data. y (..., n_y), w (..., n_w)."""
        grade = w[..., 0] if w.shape[-1] else np.zeros(y.shape[:-1])
        position = np.stack([y[..., SPEED], y[..., ACCELERATION], grade], axis=-1)
        bins = np.floor((position - self.low) / self.size)
        inside = np.all((bins >= 0) & (bins < self.counts.shape), axis=-1)
        i, j, k = np.moveaxis(np.where(inside[..., None], bins, 0).astype(int), -1, 0)
        return inside & (_grown(self.counts)[i, j, k] > 0)

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON; from_dict is its inverse."""
        return {
            "axes": ["speed m/s", "acceleration m/s^2", "grade ratio"],
            "low": list(self.low),
            "size": list(self.size),
            "counts": self.counts.tolist(),
        }

    @classmethod
    def from_dict(cls, data: dict[str, Any]) -> Coverage:
        """Inverse of to_dict. Raises KeyError, TypeError or ValueError for invalid data."""
        low, size = (tuple(map(float, data[key])) for key in ("low", "size"))
        counts = np.asarray(data["counts"], dtype=np.int64)
        if len(low) != 3 or len(size) != 3 or counts.ndim != 3 or not counts.size > 0:
            raise ValueError("not a histogram of three axes")
        if not (np.isfinite(low).all() and np.isfinite(size).all() and min(size) > 0 and counts.min() >= 0):
            raise ValueError("low, size or counts are no possible numbers")
        return cls((low[0], low[1], low[2]), (size[0], size[1], size[2]), counts)


def measure_coverage(recordings: Sequence[Recording]) -> Coverage:
    """Histogram of all finite samples of the recordings."""
    samples = np.concatenate([_samples(r) for r in recordings])
    samples = samples[np.isfinite(samples).all(axis=1)]
    size = np.array([SPEED_BIN, ACCELERATION_BIN, GRADE_BIN])
    bins = np.floor(samples / size).astype(int)
    low, high = bins.min(axis=0), bins.max(axis=0)
    counts = np.zeros(high - low + 1, dtype=np.int64)
    np.add.at(counts, tuple((bins - low).T), 1)
    a, b, c = (low * size).tolist()
    return Coverage((a, b, c), (SPEED_BIN, ACCELERATION_BIN, GRADE_BIN), counts)


def _samples(recording: Recording) -> Array:
    grade = recording.w[:, 0] if recording.interface.w else np.zeros(len(recording))
    return np.stack([recording.channels["speed"], recording.channels["acceleration"], grade], axis=1)


def _grown(counts: NDArray[np.int64]) -> NDArray[np.int64]:
    """Counts summed over each bin and its neighbours along every axis."""
    grown = np.pad(counts, 1)
    for axis in range(3):
        grown = grown + np.roll(grown, 1, axis) + np.roll(grown, -1, axis)
    return grown[1:-1, 1:-1, 1:-1]


@dataclass(frozen=True)
class Driven:
    """Speeds, commands and slopes on which a deep truck was trained; beyond them its response is an
    extrapolation.

    `samples` (n, k) float32 of speed, u and w, each divided by the distance that counts as near; `near` (k,).
    The response is omitted on purpose, because the coverage must include trucks that respond differently to
    the same commands.
    """

    samples: Rows
    near: Rows

    def covers(self, speed: Rows, u: Rows, w: Rows) -> NDArray[np.bool_]:
        """True near samples of the training data. speed (n,), u (n, n_u), w (n, n_w)."""
        rows = np.column_stack([speed, u, w]) / self.near
        tree = cKDTree(self.samples)
        least = min(len(self.samples), round(LEAST_S * PER_S))
        distance = tree.query(rows, k=[least], p=np.inf, distance_upper_bound=1.0)[0][:, 0]
        return np.asarray(np.isfinite(distance))


def measure_driven(recordings: Sequence[Recording], before: Driven | None = None) -> Driven:
    """The samples of the recordings, and those `before` of the truck that is adapted to them."""
    rows = np.concatenate([_driven_rows(r) for r in recordings])
    rows = rows[np.isfinite(rows).all(axis=1)]
    if before is not None:
        rows = np.concatenate([rows, before.samples * before.near])
    rows = rows[:: max(1, -(-len(rows) // MOST))]
    controls = len(recordings[0].interface.u)
    largest = np.abs(rows[:, 1 : 1 + controls]).max(axis=0, initial=0.0)
    grades = np.full(rows.shape[1] - 1 - controls, GRADE_NEAR)
    near = np.concatenate([[SPEED_NEAR], np.maximum(COMMAND_NEAR * largest, 1e-6), grades]).astype(np.float32)
    return Driven((rows / near).astype(np.float32), near)


def _driven_rows(recording: Recording) -> Rows:
    every = max(1, round(1.0 / (PER_S * recording.dt)))
    return np.column_stack([recording.y[:, SPEED], recording.u, recording.w])[::every]
