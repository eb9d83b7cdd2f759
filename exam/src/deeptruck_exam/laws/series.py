"""Random time series, and random profiles of roads, which are equal for all drives and both directions."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from deeptruck_core.arrays import Array
from deeptruck_exam.laws.law import Law
from deeptruck_model.trucks import View

CELL_M, CELLS = 5.0, 12000  # 60 km of road


def ou_series(rng: np.random.Generator, shape: tuple[int, int], dt: float, time_constant: float) -> Array:
    """Unit-variance coloured noise (Ornstein-Uhlenbeck) along the last axis."""
    keep = np.exp(-dt / time_constant)
    white = rng.standard_normal(shape)
    white[:, 0] /= np.sqrt(1.0 - keep**2)
    return np.asarray(lfilter([np.sqrt(1.0 - keep**2)], [1.0, -keep], white, axis=-1))


def lagged(values: Array, time_constant: float, dt: float) -> Array:
    """First-order lag along the last axis, at rest at the first value."""
    keep = np.exp(-dt / max(time_constant, 1e-3))
    first = values[..., :1] * keep
    return np.asarray(lfilter([1.0 - keep], [1.0, -keep], values, axis=-1, zi=first)[0])


def some_drives(rng: np.random.Generator, batch: int, share: float) -> NDArray[np.bool_]:
    """A random share of the recordings, at least one of the last two (held out) among them, never all."""
    count = int(np.clip(round(share * batch), 2, batch - 1))
    order = [batch - 1 - int(rng.integers(2)), *rng.permutation(batch - 2).tolist()]
    chosen = np.zeros(batch, bool)
    chosen[order[:count]] = True
    return chosen


def smooth_spans(
    rng: np.random.Generator, routes: int, gaps: tuple[float, float], lengths: tuple[float, float]
) -> Array:
    """(routes, CELLS) from 0 to 1: raised cosines over spans of road; gaps and lengths in m."""
    road = np.zeros((routes, CELLS))
    for row in road:
        at = rng.uniform(*gaps)
        while at < CELL_M * CELLS - 1000.0:
            length = rng.uniform(*lengths)
            low, high = int(at / CELL_M), int((at + length) / CELL_M)
            shape = np.sin(np.pi * (np.arange(high - low) + 0.5) / max(high - low, 1)) ** 2
            row[low:high] = rng.uniform(0.6, 1.0) * shape[: len(row) - low]
            at += length + rng.uniform(*gaps)
    return road


class OnRoad(Law):
    """A law with rows (routes, CELLS) of road values, read at the truck's position, independent of the
    driving direction."""

    road: Array

    def rows(self) -> int:
        return int(self.setting.route.max()) + 1

    def here(self, view: View) -> Array:
        """The road's value (batch,) at the truck's position."""
        cell = (self.place(view) / CELL_M).astype(int) % self.road.shape[1]
        return np.asarray(self.road[self.setting.route, cell])
