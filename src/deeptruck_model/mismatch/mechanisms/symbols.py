"""Signals used in formulas, by short names, and typical values of them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from deeptruck_core.arrays import Array
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.residual.expression import (
    Change,
    Expression,
    Lag,
    Signal,
    Since,
    absolute,
    lift,
    maximum,
    minimum,
)

SPEED, ENGINE, BRAKE = Signal("speed"), Signal("engine"), Signal("brake")
DRAG, ROLLING = Signal("drag"), Signal("rolling")
ELAPSED, DISTANCE, SIMULATED = Signal("elapsed"), Signal("distance"), Signal("simulated")
ENGINE_COMMAND = Signal("engine_command")
ENGINE_SPEED, RATIO, GEAR = Signal("engine_speed"), Signal("ratio"), Signal("gear")
# Turns per metre, but no more than the lowest gear gives: a clutch may slip.
OVERALL_RATIO = Signal("overall_ratio")
PLACE = Signal("place", missing=-1.0)  # below zero where nobody knows it
PULL = maximum(ENGINE, 0.0)
ACTS = 0.05  # m/s^2, above which the engine drives or a brake acts
CRAWL_SPEED = 1.0  # m/s, at which an engine idles in its lowest gear; below it a truck counts as standing
OMEGA = 150.0  # rad/s, a diesel's working speed
PER_POWER = -(1.0 / maximum(SPEED, CRAWL_SPEED))
SHIFTED = Since((absolute(Change((GEAR,))) > 0.5,))
STOOD = minimum(Since((SPEED < 0.5,)), 60.0)  # s since standing
BRAKED_AGO = minimum(Since((BRAKE > 0.1,)), 120.0)  # s since braking
GEARED = ("ratio", "engine_speed")
UPPER = (0.4, 0.7, 0.85, 0.93, 0.97, 0.995)  # quantiles of what acts only when it is large


def over(seconds: float, power: Expression) -> Expression:
    """A power through a first-order lag that starts at zero: the heat of the last `seconds`."""
    return Lag((power,), seconds, cold=True)


def ramp(x: Expression, start: Expression | float, length: float) -> Expression:
    """Zero up to `start`, one from `length` later on, linear between."""
    return minimum(maximum((x - start) / length, 0.0), 1.0)


def geared(reference: float) -> Expression:
    """The overall ratio over `reference` (rad/m); one if that is zero, for unknown gears."""
    return OVERALL_RATIO / reference if reference else lift(1.0)


def ratio_reference(e: Evidence) -> float:
    """Median overall ratio (rad/m) while driving, so that columns in engine terms are of order one."""
    if "ratio" not in e.signals:
        return 1.0
    ratio = e["ratio"][e.valid & np.isfinite(e["ratio"])]
    return max(float(np.median(ratio)), 1e-3) if len(ratio) else 1.0


def ratio_if_known(e: Evidence) -> float:
    """Median overall ratio (rad/m) while driving, zero if the ratio is not known."""
    return ratio_reference(e) if "ratio" in e.signals else 0.0


def torque_of(e: Evidence, reference: float) -> Array:
    """The engine torque (n,) expressed as a force at the overall ratio `reference`; the force unchanged if
    that is zero."""
    pull = np.maximum(e["engine"], 0.0)
    return pull * reference / np.maximum(e["ratio"], 0.05 * reference) if reference else pull


def quantile(e: Evidence, x: Array, where: NDArray[np.bool_], q: float) -> float:
    """A quantile of x over valid rows that satisfy `where`; infinite if these are too few."""
    rows = e.valid & where & np.isfinite(x)
    return float(np.quantile(x[rows], q)) if rows.sum() > 50 else float("inf")
