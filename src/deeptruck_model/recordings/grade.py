"""Road grade from recorded elevation."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

Array = NDArray[np.float64]

GRADE_WINDOW_M = 100.0
_CELL_M = 5.0


def grade_from_elevation(
    speed: Array, elevation: Array, dt: float, window_m: float = GRADE_WINDOW_M
) -> Array:
    """Slope rise/run at each sample, (n,): the local slope of elevation over distance driven.

    speed (n,) in m/s and elevation (n,) in m, `dt` in s. Elevation is averaged in cells of 5 m of road, so
    that standing still adds no noise, and a line is fitted around each cell with Gaussian weights of standard
    deviation window_m / 2. NaN where elevation covers too little of the road nearby to fit a line.
    """
    distance = np.concatenate([[0.0], np.cumsum(np.nan_to_num(np.maximum(speed[1:], 0.0)) * dt)])
    cell = np.floor(distance / _CELL_M).astype(np.int64)
    known = ~np.isnan(elevation)
    count = np.bincount(cell[known], minlength=cell[-1] + 1)
    has = (count > 0).astype(np.float64)
    mean = [
        np.bincount(cell[known], x[known], cell[-1] + 1) / np.maximum(count, 1) for x in (distance, elevation)
    ]
    offset = np.where(count > 0, mean[0] - _middle(mean[0], count), 0.0)
    rise = np.where(count > 0, mean[1] - _middle(mean[1], count), 0.0)
    moments = (has, has * offset, has * rise, has * offset**2, has * offset * rise)
    width = window_m / 2 / _CELL_M
    n, x, h, xx, xh = (gaussian_filter1d(m, width, mode="constant", truncate=3.0) for m in moments)
    with np.errstate(divide="ignore", invalid="ignore"):
        spread = xx / n - (x / n) ** 2
        slope = (xh / n - (x / n) * (h / n)) / spread
    slope[~(spread > (window_m / 8) ** 2)] = np.nan
    return np.interp(distance, (np.arange(cell[-1] + 1) + 0.5) * _CELL_M, slope)


def _middle(values: Array, count: NDArray[np.int64]) -> float:
    """A central value that is subtracted to keep the moments precise."""
    return float(values[count > 0].mean()) if (count > 0).any() else 0.0
