"""The error of a learned simulator on its own held-out recordings, beside which other drives are judged."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.ndimage import uniform_filter1d

from deeptruck_core.arrays import Array
from deeptruck_core.errors import InputError
from deeptruck_model.mismatch.posterior.posterior import without_roads
from deeptruck_model.mismatch.prepare.drives import with_felt_slope
from deeptruck_model.mismatch.prepare.prepared import Prepared, learned, prepare
from deeptruck_model.mismatch.residual.evidence import SLOW_NOISE_S, Evidence
from deeptruck_model.mismatch.residual.gather import gather
from deeptruck_model.mismatch.rules import Limits
from deeptruck_model.simulators import Simulator

JOLTS = 0.02  # of the time, that count for nothing


def reference_drives(simulator: Simulator, measured_acceleration: bool) -> list[Prepared]:
    """The held-out recordings stored in a learned simulator; empty if they are too short."""
    try:
        prepared = [
            learned(simulator, prepare(r, measured_acceleration))
            for r in with_felt_slope(simulator, getattr(simulator, "reference", ()))
        ]
    except InputError:
        return []
    return prepared if sum(float(p.valid.sum()) * p.dt for p in prepared) >= Limits.least_driving_s else []


def with_reference_error(
    simulator: Simulator, e: Evidence, measured_acceleration: bool, seed: int
) -> Evidence:
    """The evidence with a learned simulator's error on its held-out recordings, and the slow part of that
    error; unchanged for a physics truck."""
    if e.known_physics:
        return e
    drives = reference_drives(simulator, measured_acceleration)
    try:
        run = gather(simulator, drives, [False] * len(drives), seed=seed, rules=e.rules) if drives else None
    except InputError:
        run = None
    if run is None:
        smooth = _second_means(e)
        off = min(Limits.usual_discrepancy, 1.4826 * float(np.median(np.abs(smooth))))
        return replace(e, model_discrepancy=off, learned_slow_noise=max(off, e.rules.slow_noise))
    run = without_roads(run)  # of these recordings, which are none of its errors
    quiet = np.sort(np.abs(_second_means(run)))[: int((1.0 - JOLTS) * run.valid.sum())]
    run = replace(
        run, model_discrepancy=float(np.sqrt(np.mean(quiet**2))), learned_slow_noise=_slow_noise(run)
    )
    return replace(
        e, model_discrepancy=run.model_discrepancy, learned_slow_noise=run.slow_noise, reference=run
    )


def _second_means(e: Evidence) -> Array:
    """One-second means (m,) of the residual over rows that count."""
    smooth = uniform_filter1d(np.where(e.valid, e.residual, 0.0), max(1, round(1.0 / e.dt)))
    out: Array = smooth[e.valid]
    return out


def _slow_noise(run: Evidence) -> float:
    """Sd (m/s^2) of means over SLOW_NOISE_S due to the simulator's error, also for other drives."""
    per = max(1, round(SLOW_NOISE_S / run.dt))
    means = [0.0]
    for s in run.drives:
        rows = np.arange(s.start, s.start + (s.stop - s.start) // per * per).reshape(-1, per)
        means += run.residual[rows[run.valid[rows].all(axis=1)]].mean(axis=1).tolist()
    spread = 1.4826 * float(np.median(np.abs(means)))
    return max(run.rules.slow_noise, run.rules.tolerance * spread)
