"""What the training data covered: a histogram of speed x acceleration x grade."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from deeptruck_model.recordings import Recording
from deeptruck_model.signals import ACCELERATION, SPEED

Array = NDArray[np.float64]
SPEED_BIN, ACCELERATION_BIN, GRADE_BIN = 2.0, 0.5, 0.01  # m/s, m/s^2, ratio


@dataclass(frozen=True)
class Coverage:
    """Counts (speed, acceleration, grade) from the lowest corner `low`; a bin is `size` wide."""

    low: tuple[float, float, float]
    size: tuple[float, float, float]
    counts: NDArray[np.int64]

    def covers(self, y: Array, w: Array) -> NDArray[np.bool_]:
        """True where a sample, or a bin beside its own, was driven. y (..., n_y), w (..., n_w)."""
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
        """Inverse of to_dict. Raises KeyError, TypeError or ValueError for what is something else."""
        low, size = (tuple(map(float, data[key])) for key in ("low", "size"))
        counts = np.asarray(data["counts"], dtype=np.int64)
        if len(low) != 3 or len(size) != 3 or counts.ndim != 3 or not counts.size > 0:
            raise ValueError("not a histogram of three axes")
        if not (np.isfinite(low).all() and np.isfinite(size).all() and min(size) > 0 and counts.min() >= 0):
            raise ValueError("low, size or counts are no possible numbers")
        return cls((low[0], low[1], low[2]), (size[0], size[1], size[2]), counts)


def measure(recordings: Sequence[Recording]) -> Coverage:
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
    """Counts of each bin and its neighbours along every axis."""
    grown = np.pad(counts, 1)
    for axis in range(3):
        grown = grown + np.roll(grown, 1, axis) + np.roll(grown, -1, axis)
    return grown[1:-1, 1:-1, 1:-1]
