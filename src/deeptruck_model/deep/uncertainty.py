"""Intervals for a free run: ensemble spread and an error that grows with time, scaled to hold 90 % of held-
out points.

half width = factor * sqrt(spread^2 + (floor + growth sqrt(t))^2), per channel. The spread widens the
interval where the members disagree; floor and growth are the error they share.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.special import ndtri, stdtrit

from deeptruck_model.deep.evaluation import HORIZON_S, Trials, trials
from deeptruck_model.recordings import Recording
from deeptruck_model.simulators import Array

if TYPE_CHECKING:
    from deeptruck_model.deep.truck import DeepTruck

LEVEL = 0.9
RUNS = 600  # overlapping ones: fewer would throw data away


def calibrate(truck: DeepTruck, held_out: Sequence[Recording]) -> dict[str, Any]:
    """Factors from free runs on data that did not train the truck; lists have one entry a response channel.

    Few minutes of held-out data are few independent runs: Student's t widens the intervals accordingly.
    """
    runs = trials(truck, held_out, RUNS, HORIZON_S, seed=1)
    spread = truck.spread(runs.u, runs.w, runs.modelled[:, 0])[:, 1:]
    error, time = runs.error[:, 1:], runs.time[1:]
    entries = [_channel(error[..., j], spread[..., j], time) for j in range(error.shape[2])]
    floor, growth, factor = (list(values) for values in zip(*entries, strict=True))
    independent = max(1.0, sum(len(r) * r.dt for r in held_out) / float(time[-1]))
    caution = float(stdtrit(independent, 0.5 + LEVEL / 2) / ndtri(0.5 + LEVEL / 2))
    factor = [f * caution for f in factor]
    return {"level": LEVEL, "horizon_s": float(time[-1]), "floor": floor, "growth": growth, "factor": factor}


def calibrated(truck: DeepTruck, recordings: Sequence[Recording]) -> DeepTruck:
    """The same truck with intervals from drives it was not trained on: hours of them set the intervals better
    than the part that its own training held out."""
    entry = {**calibrate(truck, recordings), "recordings": [r.name for r in recordings]}
    return truck.with_details({"calibration": entry})


def inside(truck: DeepTruck, runs: Trials) -> dict[str, float]:
    """Share of the measured points of free runs that lie in the truck's intervals, by channel."""
    predicted = truck.predict(runs.u, runs.w, runs.modelled[:, 0])
    measured, low, high = (y[:, 1:] for y in (runs.measured, predicted.low, predicted.high))
    held = (measured >= low) & (measured <= high)
    known = np.isfinite(measured)
    return {
        name: float(held[..., j][known[..., j]].mean())
        for j, name in enumerate(runs.channels)
        if known[..., j].any()
    }


def _channel(error: Array, spread: Array, time: Array) -> tuple[float, float, float]:
    """Floor, growth and factor of one channel; error and spread (runs, T)."""
    known = np.isfinite(error)
    if not known.any():
        return 0.0, 0.0, 1.0
    count = known.sum(axis=0)
    square = np.where(known, error**2 - spread**2, 0.0).sum(axis=0) / np.maximum(count, 1)
    own = np.sqrt(np.maximum(square, 0.0))
    growth, floor = np.polyfit(np.sqrt(time), own, 1, w=np.sqrt(count)) if len(time) > 1 else (0.0, own[0])
    if growth < 0 or floor < 0:
        growth, floor = max(growth, 0.0), max(floor, 0.0)
    width = np.sqrt(spread**2 + (floor + growth * np.sqrt(time)) ** 2)
    ratio = np.abs(error[known]) / np.maximum(width[known], 1e-9)
    return float(floor), float(growth), float(np.quantile(ratio, LEVEL))
