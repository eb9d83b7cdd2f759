"""Open-loop error statistics, as in the paper: free runs from recorded starts, error mean and sd against
time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from deeptruck_model import compatibility
from deeptruck_model.compatibility import Given, Taken
from deeptruck_model.deep.data.windows import cut, has
from deeptruck_model.errors import InputError
from deeptruck_model.recordings import Recording
from deeptruck_model.signals import SPEED
from deeptruck_model.simulators import Array, Simulator, free_run

TRIALS, HORIZON_S = 90, 40.0
WITHIN = 1.5  # m/s, the paper's band for the speed error


@dataclass(frozen=True)
class Trials:
    """Free runs beside the recordings they start from: u (trials, T, n_u), w, measured and modelled y
    (trials, T, n_y).

    Measured samples are NaN where the recording is invalid. Column 0 of time is the common start.
    """

    u: Array
    w: Array
    measured: Array
    modelled: Array
    dt: float
    channels: tuple[str, ...]

    @property
    def error(self) -> Array:
        """Modelled minus measured, (trials, T, n_y)."""
        return self.modelled - self.measured

    @property
    def time(self) -> Array:
        """Seconds since the start, (T,)."""
        return np.arange(self.measured.shape[1], dtype=np.float64) * self.dt


def check(simulator: Simulator, recordings: Sequence[Recording]) -> None:
    """Raises InputError where a recording has a signal of the simulator in another unit or rate, or all lack
    it."""
    taken = Taken("the simulator", simulator.interface, simulator.dt)
    for recording in recordings:
        given = Given(
            f"'{recording.name}'",
            lambda name: not any(has(one, name) for one in recordings),
            recording.interface.unit,
            recording.dt,
        )
        for misfit in compatibility.misfits(taken, given):
            raise InputError(misfit)


def trials(
    simulator: Simulator,
    recordings: Sequence[Recording],
    count: int = TRIALS,
    horizon_s: float = HORIZON_S,
    seed: int = 0,
) -> Trials:
    """`count` free runs of `horizon_s` (shorter where no stretch is that long) from random recorded
    starts."""
    if not simulator.dt <= horizon_s < np.inf:
        raise InputError(f"a horizon of {horizon_s:g} s is none; give seconds, such as {HORIZON_S:g}")
    check(simulator, recordings)
    pieces = [p for r in recordings for p in cut(r, simulator.interface)]
    if not pieces:
        raise InputError(
            "no stretch of 3 s with valid inputs and speed in the recordings; nothing to evaluate"
        )
    dt = simulator.dt
    steps = min(round(horizon_s / dt), max(len(p) for p in pieces) - 1)
    starts = [
        (i, k)
        for i, p in enumerate(pieces)
        for k in np.flatnonzero(np.isfinite(p.channels["speed"][: max(0, len(p) - steps)]))
        if np.isfinite(p.channels["speed"][k + 1 : k + steps + 1]).any()
    ]
    rng = np.random.default_rng(seed)
    chosen = [starts[j] for j in sorted(rng.choice(len(starts), size=count, replace=len(starts) < count))]

    def stack(columns: list[Array]) -> Array:
        return np.stack([columns[i][k : k + steps + 1] for i, k in chosen])

    u, w = stack([p.u for p in pieces]), stack([p.w for p in pieces])
    measured = stack([p.y for p in pieces])
    first = measured[:, 0].copy()
    first[:, SPEED] = np.maximum(first[:, SPEED], 0.0)
    for j in range(first.shape[1]):
        column = first[:, j]
        column[np.isnan(column)] = (
            np.nanmean(measured[..., j]) if np.isfinite(measured[..., j]).any() else 0.0
        )
    modelled = free_run(simulator, u, w, first).y
    return Trials(u, w, measured, modelled, dt, simulator.interface.y)


def statistics(runs: Trials) -> dict[str, Any]:
    """Figures of merit in plain numbers; each channel in its unit, `at_end` at the end of the horizon."""
    result: dict[str, Any] = {
        "schema": 1,
        "trials": len(runs.measured),
        "horizon_s": float(runs.time[-1]),
        "dt": runs.dt,
    }
    for j, name in enumerate(runs.channels):
        error = runs.error[..., j]
        if np.isfinite(error[:, 1:]).any():
            result[name] = _channel(error[:, 1:])
    outside = np.abs(runs.error[:, 1:, SPEED]) > WITHIN
    result["speed"]["trials_within_1.5"] = float(1 - outside.any(axis=1).mean())
    return result


def _channel(error: Array) -> dict[str, float | None]:
    """Statistics of an error (trials, T); those at the end are None where nothing was measured there."""
    last = error[:, -1][np.isfinite(error[:, -1])]
    return {
        "mean": float(np.nanmean(error)),
        "mean_abs": float(np.nanmean(np.abs(error))),
        "rmse": float(np.sqrt(np.nanmean(error**2))),
        "mean_at_end": float(last.mean()) if len(last) else None,
        "sd_at_end": float(last.std()) if len(last) else None,
        "rmse_at_end": float(np.sqrt((last**2).mean())) if len(last) else None,
        "largest": float(np.nanmax(np.abs(error))),
    }


def against_time(runs: Trials) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Mean and standard deviation of the error over trials, each (T, n_y); NaN where nothing was measured."""
    error = runs.error
    known = np.isfinite(error)
    count = known.sum(axis=0)
    safe = np.where(known, error, 0.0)
    mean = np.where(count, safe.sum(axis=0) / np.maximum(count, 1), np.nan)
    variance = np.where(known, (error - mean) ** 2, 0.0).sum(axis=0) / np.maximum(count, 1)
    return mean, np.where(count, np.sqrt(variance), np.nan)
