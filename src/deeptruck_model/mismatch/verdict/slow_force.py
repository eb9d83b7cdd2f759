"""Estimates the force of an unrecorded road from the recordings alone, without a learned truck's response.

A learned truck that gets its own speed follows a slope as it follows every slow force, so that little of it
remains in its residual. A linear model of the recordings does not follow it, but slope and traction are
correlated, and an ordinary fit confuses them. They differ in their fast changes, since no slope changes
within seconds: the coefficients of engine and friction are fitted to fast changes, and the slow rest is due
to the road, the wind or a gain.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.optimize import nnls
from scipy.stats import theilslopes

from deeptruck_core.arrays import Array, Mask
from deeptruck_core.constants import AIR_DENSITY, DIESEL_J_PER_CM3, GRAVITY
from deeptruck_model.mismatch.residual.components import (
    DRIVELINE,
    EFFICIENCY,
)
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.rules import Limits

LINE_GAIN_DOUBT = 0.1  # relative error that such a line's factor of the engine's force may have
BRAKE_S, BRAKING = 2.0, 0.02  # braking is left out until it has let go, s and share of the hardest
FAST_S = 8.0  # changes within so long are no road's
SMOOTH_S = 0.7
LAGS_S = (0.0, 0.5, 1.0)  # of the force behind torque or fuel
SLOWEST = 5.0  # m/s
TURNS = 20
DRAGS = (5e-5, 5e-4)  # 1/m, drag over mass times speed squared: from a laden truck to a small car
STRIDE = 10  # Theil's slopes are of every pair
DOUBTFUL = 2.0  # robust sds from where a sample counts less


@dataclass(frozen=True)
class PlainTruck:
    """Acceleration (n,), m/s^2, that the linear model does not explain, NaN where unknown; r2 of its fast
    changes.

    `doubt` is the rms, m/s^2, of the effect of an error in the engine's gain.
    """

    left: Array
    r2: float
    doubt: float


def plain_truck(e: Evidence) -> PlainTruck | None:
    """The linear model with the largest r2; None if none explains the fast changes, or no engine signal was
    recorded."""
    tried = [_fitted(e, traction, factor) for traction, factor in _tractions(e)]
    best = max((t for t in tried if t is not None), key=lambda t: t.r2, default=None)
    return best if best is not None and best.r2 > Limits.line_r2 else None


def _tractions(e: Evidence) -> Iterator[tuple[Array, float]]:
    """A signal proportional to the engine's force at the wheels, and its factor times mass (0: unknown)."""
    speed = np.maximum(e["speed"], 3.0)
    sources = []
    if e.has("engine_torque", "engine_speed"):
        sources.append((e["engine_torque"] * e["engine_speed"] / speed, DRIVELINE))
    if e.has("engine_command", "engine_speed"):
        sources.append((e["engine_command"] * e["engine_speed"] / speed, 0.0))
    if e.has("engine_command"):
        sources.append((e["engine_command"], 0.0))  # one gear
    if e.has("fuel_rate"):
        sources.append((e["fuel_rate"] / speed, EFFICIENCY * DIESEL_J_PER_CM3))
    for traction, factor in sources:
        for lag_s in LAGS_S:
            yield (e.lag(traction, lag_s) if lag_s else np.nan_to_num(traction)), factor


def _fitted(e: Evidence, traction: Array, factor: float) -> PlainTruck | None:
    speed = e["speed"]
    friction = (
        np.nan_to_num(e["engine_speed"]) / np.maximum(speed, 3.0) if e.has("engine_speed") else 0 * speed
    )
    changed = np.concatenate([[0.0], np.diff(speed)]) / e.dt
    if e.has("grade"):
        changed = changed + GRAVITY * np.nan_to_num(e["grade"])
    use = e.valid & (speed > SLOWEST) & ~e.starts & np.isfinite(changed)
    if e.has("brake_command"):
        command = np.nan_to_num(e["brake_command"])
        use &= e.lag(command, BRAKE_S) < BRAKING * max(float(command.max(initial=0.0)), 1e-9)
    if use.sum() * e.dt < Limits.line_s:
        return None
    y, X = _fast(e, changed), np.stack([_fast(e, traction), -_fast(e, friction)], axis=1)
    y, X = y[use], X[use]
    weight, b = np.ones(len(y)), np.zeros(2)
    scale = np.maximum(np.abs(X).mean(axis=0), 1e-12)
    for _ in range(TURNS):
        root = np.sqrt(weight)[:, None]
        b = nnls(X / scale * root, y * root[:, 0])[0] / scale
        off = y - X @ b
        weight = 1.0 / (1.0 + (off / (DOUBTFUL * 1.4826 * np.median(np.abs(off)) + 1e-9)) ** 2)
    if b[0] <= 0.0:
        return None
    r2 = 1.0 - float(weight @ (y - X @ b) ** 2 / max(weight @ y**2, 1e-12))
    left = changed - b[0] * traction + b[1] * friction
    if factor:
        mass = float(np.clip(factor / b[0], e.vehicle.least_mass_kg, e.vehicle.most_mass_kg))
        left += 0.5 * AIR_DENSITY * e.vehicle.drag_area / mass * speed**2
    else:
        slope = theilslopes(left[use][::STRIDE], speed[use][::STRIDE] ** 2).slope
        left += float(np.clip(-slope, *DRAGS)) * speed**2
    left = np.where(use, left - np.median(left[use]), np.nan)
    pull = b[0] * traction[use]
    return PlainTruck(left, r2, LINE_GAIN_DOUBT * float(np.std(pull)))


def _fast(e: Evidence, x: Array) -> Array:
    """The signal minus its slow part, for each recording."""
    out = np.empty_like(x)
    for s in e.drives:
        part = gaussian_filter1d(np.nan_to_num(x[s.rows]), SMOOTH_S / e.dt, mode="reflect")
        out[s.rows] = part - gaussian_filter1d(part, FAST_S / e.dt, mode="reflect")
    return out


WIDTH_S = 8.0


@dataclass(frozen=True)
class SlowForce:
    """The force (n,) in m/s^2, 0 where unknown, its rms, and the size that each possible cause would need:
    slope, wind in m/s, share of the engine's force."""

    force: Array
    rms: float
    needed: dict[str, float]


def slow_force(e: Evidence, left: Array, weight: Array, sigma: float, doubt: float = 0.0) -> SlowForce | None:
    """The slow part of `left` (n,), the residual of the linear model; None where it is small.

    `weight` (n,) is the weight of each sample, `sigma` the sd of one sample's noise, `doubt` the rms of the
    part of `left` that may have another cause.
    """
    if e.valid.sum() * e.dt < Limits.line_s:
        return None
    centred, known = _slow_part(e, left, weight)
    rms = float(np.sqrt(np.mean(centred[known] ** 2)))
    noise = e.rules.tolerance * sigma / np.sqrt(2.0 * np.sqrt(np.pi) * WIDTH_S / e.dt)
    if rms < max(float(np.hypot(e.rules.slow_force, doubt)), noise):
        return None
    speed, pull = np.maximum(e["speed"], 3.0), np.maximum(e["engine"], 0.0)
    per_wind = 2.0 * e["drag"] / speed
    needed = {
        "road_grade": rms / GRAVITY,
        "headwind": _size(centred, per_wind, known),
        "torque_derate": _size(centred, pull, known),
    }
    return SlowForce(np.where(known, centred, 0.0), rms, needed)


def _slow_part(e: Evidence, left: Array, weight: Array) -> tuple[Array, Mask]:
    """The slow part minus its mean, and where it is known, both (n,)."""
    width = WIDTH_S / e.dt
    use = np.where(e.valid, weight, 0.0)
    amount = gaussian_filter1d(use, width)
    smooth = gaussian_filter1d(np.where(e.valid, left, 0.0) * use, width) / np.maximum(amount, 1e-3)
    known = e.valid & (amount > 0.2 * float(np.median(amount[e.valid])))
    return smooth - float(np.mean(smooth[known])), known


def _size(force: Array, per_unit: Array, known: Mask) -> float:
    """Rms size of a cause with the effect `per_unit`, where it has any effect."""
    acting = known & (per_unit > 0.3 * float(np.mean(per_unit[known])))
    if not acting.any():
        return float("inf")
    return float(
        np.sqrt(np.mean(force[acting] ** 2)) / max(float(np.sqrt(np.mean(per_unit[acting] ** 2))), 1e-9)
    )
