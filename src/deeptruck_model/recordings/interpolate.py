"""Resamples one channel from its own times to the ticks of a clock.

Time indices are the paper's (see simulators.py): a command is held from tick k to k+1, so u(k) is the mean of
the held signal over that step; acceleration and fuel rate at tick k+1 are means over the step before it, so
v(k+1) = v(k) + a(k+1) dt holds at every rate. Other channels are interpolated between neighbouring samples.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from deeptruck_core.arrays import Array
from deeptruck_core.signals import FAULTS

GAP_S = 1.5  # a hole longer than this, and than GAP_PERIODS of the source's own periods, is not bridged
GAP_PERIODS = 3.0
SNAP = 1e-3  # a sample this close to a tick, in steps, is that tick's value

HELD = ("engine_command", "brake_command")
LATCHED = ("gear", "brake_switch", *FAULTS)
_STEP_MEANS = ("acceleration", "specific_force", "fuel_rate")


@dataclass(frozen=True)
class Series:
    """Samples of one channel: time (n,) in s since the start of the source, ascending; values (n,)."""

    time: Array
    values: Array

    def between(self, after: float, before: float) -> Series:
        """The samples strictly between two times."""
        inside = slice(np.searchsorted(self.time, after, side="right"), np.searchsorted(self.time, before))
        return Series(self.time[inside], self.values[inside])

    @property
    def valid(self) -> Series:
        """The samples that are numbers."""
        known = ~np.isnan(self.values)
        return Series(self.time[known], self.values[known])


def period(time: Array) -> float:
    """The sample period of a source, s: its median step; 0 for fewer than two samples."""
    return float(np.median(np.diff(time))) if len(time) > 1 else 0.0


def at_ticks(
    channel: str,
    time: Array,
    values: Array,
    ticks: Array,
    dt: float,
    own_period: float,
    *,
    first: bool = True,
) -> Array:
    """The channel at the ticks (n,); NaN where no sample is near. NaN samples are not interpolated across.

    `time` (m,) ascending and `values` (m,) extend beyond the ticks as far as holding and interpolation reach;
    `first` says that no step was recorded before ticks[0].
    """
    if not len(time):
        return np.full(len(ticks), np.nan)
    patience = max(GAP_S, GAP_PERIODS * own_period)
    if channel in HELD:
        return _step_mean_of_held(time, values, ticks, dt, patience)
    if channel in LATCHED:
        return held(time, values, ticks, patience, dt)[0]
    near = max(GAP_PERIODS * own_period, 1.5 * dt)
    if channel in _STEP_MEANS and 0 < own_period < 0.7 * dt:
        means = _mean_of_step_before(time, values, ticks, dt, own_period)
        if first:
            means[0] = _linear(time, values, ticks[:1], dt, near)[0]
        return means
    return _linear(time, values, ticks, dt, near)


def _linear(time: Array, values: Array, ticks: Array, dt: float, near: float) -> Array:
    high = np.clip(np.searchsorted(time, ticks), 0, len(time) - 1)
    low = np.maximum(high - 1, 0)
    closest = np.where(np.abs(time[high] - ticks) <= np.abs(ticks - time[low]), high, low)
    on_tick = np.abs(time[closest] - ticks) <= SNAP * dt
    width = time[high] - time[low]
    usable = (width > 0) & (width <= near * (1 + 1e-9)) & (ticks >= time[low]) & (ticks <= time[high])
    weight = np.where(usable, (ticks - time[low]) / np.where(width > 0, width, 1.0), np.nan)
    between = values[low] + (values[high] - values[low]) * weight
    return np.where(on_tick, values[closest], between)


def held(
    time: Array, values: Array, ticks: Array, patience: float, dt: float = 0.0
) -> tuple[Array, NDArray[np.int64]]:
    """Last value at or before each tick, to a part of the step `dt`, NaN where older than `patience`; and its
    index, -1 for none."""
    index = np.searchsorted(time, ticks + SNAP * dt, side="right") - 1
    if not len(time):
        return np.full(len(ticks), np.nan), index
    safe = np.maximum(index, 0)
    fresh = (index >= 0) & (ticks - time[safe] <= patience)
    return np.where(fresh, values[safe], np.nan), index


def _step_mean_of_held(time: Array, values: Array, ticks: Array, dt: float, patience: float) -> Array:
    """Mean over [t_k, t_k + dt) of the zero-order-held command; the sample if it does not change."""
    last_before, first = held(time, values, ticks, patience, dt)
    last = np.searchsorted(time, ticks + (1 - SNAP) * dt) - 1
    if np.array_equal(first, last):
        return last_before
    ends = np.append(ticks, ticks[-1] + dt)
    inner = time[(time > ends[0]) & (time < ends[-1])]
    edges = np.sort(np.concatenate([ends, inner]))
    level = held(time, values, edges[:-1], patience, dt)[0]
    area = np.add.reduceat(level * np.diff(edges), np.searchsorted(edges[:-1], ticks))
    return np.where(first == last, last_before, area / dt)


def _mean_of_step_before(time: Array, values: Array, ticks: Array, dt: float, own_period: float) -> Array:
    """Mean of the samples in (t_k - dt, t_k]; NaN if fewer than half of the expected ones exist."""
    ends = np.searchsorted(time, ticks + SNAP * dt, side="right")
    starts = np.searchsorted(time, ticks - (1 - SNAP) * dt, side="right")
    counts = ends - starts
    enough = counts >= 0.5 * dt / own_period
    edges = np.stack([starts, np.maximum(ends, starts + 1)], axis=1).ravel()
    sums = np.add.reduceat(np.append(values, [0.0, 0.0]), edges)[::2]
    return np.where(enough, sums / np.maximum(counts, 1), np.nan)
