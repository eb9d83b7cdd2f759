"""The time of a shift within a sample: a truck with finer steps than its simulator shifts earlier."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from deeptruck_core.signals import SPEED
from deeptruck_model.mismatch.prepare.prepared import Prepared
from deeptruck_model.mismatch.residual.forced import Grid, accelerations
from deeptruck_model.simulators import Simulator

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

LEAST_CHANGE = 1e-3  # m/s^2 by deciding a sample sooner, for a row to say anything of the moment
FEWEST = 5  # such rows, to estimate the moment by


def of_a_sample_sooner(simulator: Simulator, prepared: Sequence[Prepared], grid: Grid) -> Array:
    """The change of the simulated acceleration (n,) if the truck decides to shift one sample earlier.

    A truck with finer steps than its simulator always shifts before it; this difference is no missing
    physics.
    """
    us = [p.u for p in prepared]
    after, before = (
        accelerations(
            simulator,
            [replace(p, y=at_another_moment(p.y, side * p.dt, p.observed)) for p in prepared],
            grid,
            us,
        )
        for side in (1.0, -1.0)
    )
    return (after - before) / 2.0


def samples_apart(residual: Array, sooner: Array, valid: Mask) -> float:
    """How far apart the two shifts may be: the median ratio of the residual to its change by one sample,
    weighted by that change, so that a force at each shift does not affect it. As `sooner` is half of the
    difference between one sample later and one earlier, this is twice the offset in samples, limited to 1:
    half a sample is the most that is distinguished."""
    informative = valid & (np.abs(sooner) > LEAST_CHANGE)
    if informative.sum() < FEWEST:
        return 0.0
    ratio, weight = residual[informative] / sooner[informative], np.abs(sooner[informative])
    order = np.argsort(ratio)
    sums = np.cumsum(weight[order])
    return min(abs(float(ratio[order][np.searchsorted(sums, sums[-1] / 2.0)])), 1.0)


def at_another_moment(y: Array, later_s: float | Array, acceleration: Array) -> Array:
    """Responses (..., T, n_y) whose speed is shifted by `later_s`, given the acceleration (T,)."""
    y = y.copy()
    y[..., SPEED] = np.maximum(y[..., SPEED] + later_s * acceleration, 0.0)
    return y
