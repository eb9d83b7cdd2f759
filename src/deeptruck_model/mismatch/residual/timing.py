"""What ordinary sensors and loggers do to time: they delay or smooth a response, and a truck with finer steps
than its simulator shifts earlier.

These nuisance terms are in every model and never a finding. Without them a filter of 0.1 s gains a hundred
nats at the shifts of low gears, and effects such as sloshing loads and friction would be fitted to it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.ndimage import uniform_filter1d

from deeptruck_core.arrays import Array, Mask
from deeptruck_core.constants import GRAVITY
from deeptruck_core.signals import SPEED
from deeptruck_model.mismatch.prepare.prepared import Prepared
from deeptruck_model.mismatch.residual.evidence import Evidence, Grid, accelerations
from deeptruck_model.mismatch.residual.noise import Prior
from deeptruck_model.simulators import Simulator

# Filters of ordinary speed sensors and message periods make every response a little late (s).
SENSOR_LAG = Prior(np.array([0.03, 0.03]), np.array([0.06, 0.06]), np.zeros(2))
SLOPE_LATE_S = 0.4  # prior sd: sensors of slope are filtered, and by elevation and distance late or early
SMOOTH_S = 1.0  # of the recorded slope, so that its steps are no turns of the road
REACH_S = 0.6  # from how far before and after a sample a sensor's filter may take a share ...
ROUNDING = 1e-6
SHARE = 0.06  # ... and the prior sd of each
SAMPLES = 1.0  # prior sd: by so many a truck decides sooner or later than its simulator, as when to shift


def sensor_terms(e: Evidence, *, of_commands: bool = True) -> tuple[Array, Prior]:
    """Columns (n, k), m/s^2, and the prior of their shares; without `of_commands` commands are not late."""
    least = e.rules.least_delay_s
    late = [
        -e.difference(e.simulated),
        e.rerun("delay_all", least) / least if of_commands else np.zeros(len(e)),
    ]
    slope = _late_slope(e)
    reach = filter_reach(e)
    filtered = [_row_after(e, k) - e.simulated for k in range(-reach, reach + 1) if k]
    sooner = [] if e.sooner is None else [e.sooner]
    prior = Prior.join(
        SENSOR_LAG,
        _around_nothing(len(slope), SLOPE_LATE_S),
        _around_nothing(len(filtered), SHARE),
        _around_nothing(len(sooner), SAMPLES),
    )
    return np.column_stack([*late, *slope, *filtered, *sooner]), prior


def _late_slope(e: Evidence) -> list[Array]:
    """Apparent acceleration (n,), m/s^2, if slope is recorded one second late; empty without a recorded
    slope."""
    if not e.has("grade"):
        return []
    turns, over = np.zeros(len(e)), max(1, round(SMOOTH_S / e.dt))
    for s in e.drives:
        grade, at = e["grade"][s.rows], np.arange(s.stop - s.start)
        recorded = np.isfinite(grade)
        if (
            recorded.any() and len(grade) > over
        ):  # straight on over what is missing: a hole is no turn of the road
            whole = np.interp(at, at[recorded], grade[recorded])
            turns[s.rows] = np.gradient(uniform_filter1d(whole, over)) / e.dt
    gain = e.signals.get("effective_mass_gain", np.ones(len(e)))
    return [-GRAVITY * gain * turns]


def filter_reach(e: Evidence) -> int:
    """Rows before and after a sample that a filter reaches; none if the sample period is too long for one, as
    for a learned simulator."""
    return int(REACH_S / e.dt + ROUNDING)


def _row_after(e: Evidence, k: int) -> Array:
    """The simulated acceleration k rows later; the last one beyond the end."""
    rows = np.arange(len(e)) + k
    parts = [np.clip(rows[s.rows], s.start, s.stop - 1) for s in e.drives]
    out: Array = e.simulated[np.concatenate(parts)]
    return out


def _around_nothing(count: int, sd: float) -> Prior:
    return Prior(np.zeros(count), np.full(count, sd), np.zeros(count))


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
