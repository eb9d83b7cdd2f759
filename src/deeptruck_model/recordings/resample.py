"""From samples at their own times to one uniform clock, cut into contiguous pieces.

A recording's clock follows the speed samples. Time indices are the paper's (see simulators.py): commands
are held from sample k to k+1, so u(k) is the mean of the held signal over that step; acceleration and
fuel rate of sample k+1 are means over the step before it, so v(k+1) = v(k) + a(k+1) dt survives the
change of rate.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from deeptruck_model.errors import InputError
from deeptruck_model.recordings.recording import Recording
from deeptruck_model.signals import CHANNELS, TruckInterface

Array = NDArray[np.float64]

GAP_S = 1.5  # a longer hole in the speed cuts the recording
GAP_PERIODS = 3.0  # ... as do more than this many of the source's own periods
_SNAP = 1e-3  # a sample this close to a clock tick, in steps, is that tick's value

_HELD = ("engine_command", "brake_command")
_LATCHED = ("gear",)
_STEP_MEANS = ("acceleration", "fuel_rate")


@dataclass(frozen=True)
class Series:
    """One channel as it came: time (n,) in s since the start of the source, ascending; values (n,)."""

    time: Array
    values: Array


def uniform(
    series: dict[str, Series],
    *,
    name: str,
    interface: TruckInterface,
    rate_hz: float = 10.0,
    cuts: Sequence[float] = (),
    notes: Sequence[str] = (),
) -> list[Recording]:
    """Recordings on one clock at `rate_hz`, or at the speed channel's own rate where that is slower.

    Cut where speed is missing for more than max(GAP_S, GAP_PERIODS native periods), and before every time in
    `cuts`. Samples outside the channel's range become NaN. Raises InputError without speed, or where so much
    is out of range that the unit must be wrong.
    """
    if "speed" not in series or len(series["speed"].time) < 2:
        raise InputError(f"'{name}' has fewer than two speed samples: nothing to make a recording of")
    notes = list(notes)
    valid = {channel: _in_range(channel, s, name, notes) for channel, s in series.items()}
    clock = valid["speed"].time
    native = _period(clock)
    dt = _step(clock, native, rate_hz)
    bounds = _pieces(clock, max(GAP_S, GAP_PERIODS * native), cuts)
    kept = [(i, j) for i, j in bounds if j - i > 1]
    if len(kept) < len(bounds):
        notes.append(f"dropped {len(bounds) - len(kept)} single speed samples between gaps")
    if not kept:
        raise InputError(f"'{name}' has no two speed samples in a row: nothing to make a recording of")
    recordings = []
    for number, (i, j) in enumerate(kept):
        before = clock[i - 1] if i else -np.inf
        after = clock[j] if j < len(clock) else np.inf
        grid = clock[i] + dt * np.arange(int((clock[j - 1] - clock[i]) / dt + _SNAP) + 1)
        piece_notes = list(notes)
        channels = {
            channel: _resampled(channel, _between(s, before, after), grid, dt) for channel, s in valid.items()
        }
        needed = {*interface.u, *interface.w, *interface.y}  # stay, as NaN, where another piece has them
        channels = {c: v for c, v in channels.items() if c in needed or not np.isnan(v).all()}
        if "acceleration" not in channels:
            channels["acceleration"] = derive_acceleration(channels["speed"], dt)
            piece_notes.append("acceleration derived from speed")
        piece_name = name if len(kept) == 1 else f"{name}#{number}"
        recordings.append(Recording(piece_name, dt, channels, interface, float(grid[0]), tuple(piece_notes)))
    return recordings


def derive_acceleration(speed: Array, dt: float) -> Array:
    """Mean acceleration over each step, a(k+1) = (v(k+1) - v(k)) / dt, (n,); the first repeats the second."""
    acceleration = np.empty_like(speed)
    acceleration[1:] = np.diff(speed) / dt
    acceleration[0] = acceleration[1] if len(speed) > 1 else 0.0
    return acceleration


def _in_range(channel: str, series: Series, name: str, notes: list[str]) -> Series:
    low, high = CHANNELS[channel].low, CHANNELS[channel].high
    with np.errstate(invalid="ignore"):
        outside = ~np.isnan(series.values) & ~((series.values >= low) & (series.values <= high))
    count = int(outside.sum())
    if not count:
        return series
    measured = int((~np.isnan(series.values)).sum())
    if count > (0.01 if channel == "speed" else 0.2) * measured:
        worst = series.values[outside][np.argmax(np.abs(series.values[outside]))]
        raise InputError(
            f"'{name}': {count} of {measured} samples of '{channel}' lie outside {low:g}..{high:g} "
            f"{CHANNELS[channel].unit} (for example {worst:g}): is its unit right?"
        )
    notes.append(f"{count} samples of {channel} outside {low:g}..{high:g} made invalid")
    return Series(series.time, np.where(outside, np.nan, series.values))


def _period(time: Array) -> float:
    return float(np.median(np.diff(time))) if len(time) > 1 else 0.0


def _step(clock: Array, native: float, rate_hz: float) -> float:
    """The recording's dt: that of rate_hz, or the source's own where it is slower by more than 5 %."""
    if not rate_hz > 0:
        raise InputError(f"rate_hz must be positive, not {rate_hz}")
    if native <= 1.05 / rate_hz:
        return 1.0 / rate_hz
    steps = np.diff(clock)
    mean = float(steps[steps < 1.5 * native].mean())
    neat = round(mean, 3)
    return neat if abs(neat - mean) < 5e-4 * mean else mean


def _pieces(clock: Array, gap: float, cuts: Sequence[float]) -> list[tuple[int, int]]:
    starts = set(np.flatnonzero(np.diff(clock) > gap) + 1) | set(np.searchsorted(clock, np.asarray(cuts)))
    edges = sorted({0, len(clock)} | {int(s) for s in starts if 0 < s < len(clock)})
    return list(zip(edges[:-1], edges[1:], strict=True))


def _between(series: Series, before: float, after: float) -> Series:
    inside = slice(
        int(np.searchsorted(series.time, before, side="right")), int(np.searchsorted(series.time, after))
    )
    return Series(series.time[inside], series.values[inside])


def _resampled(channel: str, series: Series, grid: Array, dt: float) -> Array:
    """The channel at the clock's ticks, NaN where nothing near was measured."""
    time, values = series.time, series.values
    if not len(time):
        return np.full(len(grid), np.nan)
    period = _period(time)
    if channel in _HELD:
        return _step_mean_of_held(time, values, grid, dt, max(GAP_S, GAP_PERIODS * period))
    if channel in _LATCHED:
        return _held(time, values, grid, dt, max(GAP_S, GAP_PERIODS * period))[0]
    near = max(GAP_PERIODS * period, 1.5 * dt)
    if channel in _STEP_MEANS and 0 < period < 0.7 * dt:
        return _mean_of_step_before(time, values, grid, dt, near)
    return _linear(time, values, grid, dt, near)


def _linear(time: Array, values: Array, grid: Array, dt: float, near: float) -> Array:
    high = np.clip(np.searchsorted(time, grid), 0, len(time) - 1)
    low = np.maximum(high - 1, 0)
    closest = np.where(np.abs(time[high] - grid) <= np.abs(grid - time[low]), high, low)
    on_tick = np.abs(time[closest] - grid) <= _SNAP * dt
    width = time[high] - time[low]
    usable = (width > 0) & (width <= near * (1 + 1e-9)) & (grid >= time[low]) & (grid <= time[high])
    weight = np.where(usable, (grid - time[low]) / np.where(width > 0, width, 1.0), np.nan)
    between = values[low] + (values[high] - values[low]) * weight
    return np.where(on_tick, values[closest], between)


def _held(
    time: Array, values: Array, ticks: Array, dt: float, limit: float
) -> tuple[Array, NDArray[np.int64]]:
    """The last value at or before each tick, NaN where it is older than `limit`; and its index, -1 for none."""
    index = np.searchsorted(time, ticks + _SNAP * dt, side="right") - 1
    safe = np.maximum(index, 0)
    fresh = (index >= 0) & (ticks - time[safe] <= limit)
    return np.where(fresh, values[safe], np.nan), index


def _step_mean_of_held(time: Array, values: Array, grid: Array, dt: float, limit: float) -> Array:
    """Mean over [t_k, t_k + dt) of the zero-order-held command; the sample itself where it does not change."""
    held, first = _held(time, values, grid, dt, limit)
    last = np.searchsorted(time, grid + (1 - _SNAP) * dt) - 1
    if np.array_equal(first, last):
        return held
    ends = np.append(grid, grid[-1] + dt)
    inner = time[(time > ends[0]) & (time < ends[-1])]
    edges = np.sort(np.concatenate([ends, inner]))
    widths = np.diff(edges)
    level = _held(time, values, edges[:-1], dt, limit)[0]
    area = np.add.reduceat(level * widths, np.searchsorted(edges[:-1], grid))
    return np.where(first == last, held, area / dt)


def _mean_of_step_before(time: Array, values: Array, grid: Array, dt: float, near: float) -> Array:
    """Mean of the samples in (t_k - dt, t_k]; NaN where fewer than half of the expected ones are there."""
    ends = np.searchsorted(time, grid + _SNAP * dt, side="right")
    starts = np.searchsorted(time, grid - (1 - _SNAP) * dt, side="right")
    counts = ends - starts
    enough = counts >= 0.5 * dt / _period(time)
    edges = np.stack([starts, np.maximum(ends, starts + 1)], axis=1).ravel()
    sums = np.add.reduceat(np.append(values, 0.0), edges)[::2]
    means = np.where(enough, sums / np.maximum(counts, 1), np.nan)
    means[0] = _linear(time, values, grid[:1], dt, near)[0]  # the step before the first tick was not recorded
    return means
