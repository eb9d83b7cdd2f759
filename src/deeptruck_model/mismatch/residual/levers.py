"""Turns of the engine per metre as they are in the gears, without the noise of two sensors.

Engine speed and road speed are not sampled at one moment, so that their ratio tells a little of the
acceleration and of the noise in it; and while a clutch slips it is no lever at all.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

MOST_TURNS = 150.0  # rad/m: a crawler gear
LOCKED_M_S = 2.5  # slower, a starting clutch may slip
BIN, WIDTH = 0.02, 0.06  # of the logarithm; gears of a truck are at least 0.15 apart
SELDOM = 0.005  # share of the time below which a ratio is no gear


def turns(engine_speed: Array, speed: Array) -> Array:
    """Turns per metre, rad/m, (n,); NaN where the engine speed is not known."""
    ratio = engine_speed / np.maximum(speed, 0.5)
    out: Array = np.where(np.isfinite(ratio), np.clip(ratio, 0.0, MOST_TURNS), np.nan)
    return out


def gears(ratio: Array, speed: Array) -> tuple[float, ...]:
    """The turns per metre at which driving gathers, rad/m, ascending; none where there is no driving."""
    left = np.log(ratio[np.isfinite(ratio) & (ratio > 0.1) & (speed > LOCKED_M_S)])
    count, found = len(left), []
    while len(left) > max(SELDOM * count, 20):
        bins, edges = np.histogram(left, np.arange(left.min() - BIN, left.max() + 2 * BIN, BIN))
        most = edges[int(np.argmax(bins))] + BIN / 2
        near = np.abs(left - most) < WIDTH
        if near.sum() < SELDOM * count:
            break
        found.append(float(np.exp(np.median(left[near]))))
        left = left[~(np.abs(left - np.log(found[-1])) < 2 * WIDTH)]
    return tuple(sorted(found))


def lever(ratio: Array, known: Sequence[float], in_gear: Array | None = None) -> Array:
    """The gear's own turns per metre near one of the `known`. Elsewhere a clutch slips: what it would be
    `in_gear`, where a simulator tells, or the ratio, but never beyond the lowest."""
    if not known:
        return ratio
    centres = np.log(np.asarray(known))
    x = np.log(np.maximum(np.nan_to_num(ratio, nan=0.1), 0.1))
    nearest = np.argmin(np.abs(x[:, None] - centres), axis=1)
    near = np.abs(x - centres[nearest]) < WIDTH
    slipping = np.minimum(ratio, known[-1]) if in_gear is None else in_gear
    out: Array = np.where(near, np.asarray(known)[nearest], slipping)
    return out
