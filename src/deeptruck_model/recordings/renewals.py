"""Samples that were not measured, in any reader's series: bursts, values held between renewals, and straight
lines between them.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from deeptruck_core.account import Tally, moment
from deeptruck_core.arrays import Array
from deeptruck_model.recordings.interpolate import HELD, LATCHED, Series

LEAST_RENEWALS = 20  # by which a value is seen to be held between them
LEAST_LINE, STRAIGHT = 5.0, 0.75  # rows of a straight line; part of all rows that then has no bend
MOST_UNBENT = 8  # lines in a row that may happen to go on in one direction
COARSE, SOONEST = 2.5, 0.6  # resolutions by which a coarse sensor changes; of the usual rows between renewals
BURSTS, LARGEST_BURST = 5, 20  # that are seen at least; samples in one
BURST_PAUSE = 5.0  # times that a pause between bursts is longer than the step within


def renewed(channel: str, series: Series, tally: Tally) -> tuple[Array, Array]:
    """Times and values of the samples that were measured, (k,); those that a logger, an exporter or another
    node filled in between are counted in the `tally`."""
    valid = np.flatnonzero(~np.isnan(series.values))
    for how, found in (("held", renewals), ("on a straight line", knots)):
        if how == "held" and channel in (*HELD, *LATCHED):  # states, which stay as they are for long
            continue
        rows = valid[found(np.clip(series.values[valid], -1e12, 1e12))]  # infinities have no difference
        if len(rows):
            every = round(float(np.median(np.diff(rows))))
            if how == "held":
                rows = np.union1d(rows, valid[-1:])  # up to which the last one is
            filled = np.setdiff1d(valid, rows)
            tally.set_aside(
                f"{how} between the samples that renew it, about every {every}",
                f"at {moment(series.time[filled[0]])}",
                len(filled),
            )
            return series.time[rows], series.values[rows]
    return series.time, series.values


def renewals(values: Array) -> NDArray[np.int64]:
    """Rows (k,) at which a value that is held between them was renewed; none if it is not held.

    A sensor of coarse resolution also repeats its value, but for a varying number of rows, and then changes
    by its resolution. A value that stays for longer than usual was renewed in between with the same number.
    """
    changes = np.flatnonzero(np.diff(values, prepend=np.nan) != 0.0)
    apart = np.diff(changes[1:])
    if len(apart) < LEAST_RENEWALS or (every := int(np.median(apart))) < 2:
        return np.zeros(0, dtype=np.int64)
    off = np.abs(apart - every * np.rint(apart / every))
    regular = (off <= every // 10).mean() > 0.95
    resolution = float(np.diff(np.unique(np.round(values, 9))).min())
    coarse = float(np.median(np.abs(np.diff(values[changes])))) < COARSE * resolution
    if not regular and (coarse or (apart < SOONEST * every).mean() > 0.05):
        return np.zeros(0, dtype=np.int64)
    runs = [(i, j, max(1, round((j - i) / every))) for i, j in pairwise([*changes, len(values)])]
    return np.concatenate([i + (j - i) * np.arange(count) // count for i, j, count in runs])


def knots(values: Array) -> NDArray[np.int64]:
    """Rows (k,) at which straight lines meet, as where an exporter put a slow signal on a faster clock; none
    if there are none. Where nothing was recorded one line goes on for long, and no row of it was measured;
    where the value stays it may well have been."""
    bends = np.abs(np.diff(values, 2))
    if len(bends) < LEAST_RENEWALS or not (size := float(np.max(np.abs(values)))):
        return np.zeros(0, dtype=np.int64)
    at = np.flatnonzero(bends > max(2.0 * float(np.quantile(bends, STRAIGHT)), 1e-9 * size)) + 1
    apart = np.diff(at)
    if len(apart) < LEAST_RENEWALS or (every := float(np.median(apart))) < LEAST_LINE:
        return np.zeros(0, dtype=np.int64)
    if (np.abs(apart - every * np.rint(apart / every)) > 1.0).mean() > 0.05:
        return np.zeros(0, dtype=np.int64)
    # the first and last line may be cut off by the table, which is no sample then
    whole = [abs(k - every * round(k / every)) < 0.5 for k in (at[0], len(values) - 1 - at[-1])]
    edges = np.concatenate([[0] if whole[0] else [], at, [len(values) - 1] if whole[1] else []]).astype(int)
    runs = [(i, j, round((j - i) / every)) for i, j in pairwise(edges)]
    between = [
        i + (j - i) * np.arange(1, k) // k
        for i, j, k in runs
        if k > 1 and (k <= MOST_UNBENT or values[i] == values[j])
    ]
    return np.unique(np.concatenate([edges, *between]))


def one_per_burst(channel: str, time: Array, values: Array) -> tuple[Array, Array]:
    """The mean of each burst, at its mean time, (k,), or the first value of a command or state; all samples
    if they do not come in bursts.

    Loggers that save memory record a few samples close together every second or so. Their rate is that of
    the bursts.
    """
    steps = np.diff(time)
    if len(steps) < BURSTS:
        return time, values
    apart = BURST_PAUSE * float(np.median(steps))
    starts = np.r_[0, np.flatnonzero(steps > apart) + 1]
    sizes = np.diff(np.r_[starts, len(time)])
    pauses = np.diff(time[starts])
    usual = float(np.median(pauses)) if len(pauses) else 0.0
    if len(starts) < BURSTS or sizes.max() > LARGEST_BURST or (pauses > 2.0 * usual).mean() > 0.1:
        return time, values
    if channel in (*HELD, *LATCHED):
        return time[starts], values[starts]
    known = np.isfinite(values)
    sums = np.add.reduceat(np.where(known, values, 0.0), starts)
    with np.errstate(invalid="ignore"):
        means = sums / np.add.reduceat(known.astype(float), starts)
    return np.add.reduceat(time, starts) / sizes, means
