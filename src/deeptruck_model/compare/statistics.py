"""Statistics of a drive, and of the difference between two."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from deeptruck_core.arrays import Array
from deeptruck_model.compare.sides import Side

ROLLING = 2.0  # m/s; slower, a time gap says nothing
BRAKES = 0.05  # share of the hardest braking from which a brake command counts
LITRES_100_KM = 100.0  # cm^3/m in l/100 km


@dataclass(frozen=True)
class Statistics:
    """Statistics of one side; None if a required channel was not recorded."""

    duration_s: float
    distance_m: float
    mean_speed_m_s: float
    highest_speed_m_s: float
    acceleration_rms_m_s2: float
    jerk_rms_m_s3: float
    braking_share: float | None
    mean_gap_m: float | None
    least_gap_m: float | None
    median_time_gap_s: float | None
    least_time_gap_s: float | None
    fuel_l_per_100_km: float | None


NAMES = {  # how people read them
    "duration_s": ("duration", "s"),
    "distance_m": ("distance", "m"),
    "mean_speed_m_s": ("mean speed", "m/s"),
    "highest_speed_m_s": ("highest speed", "m/s"),
    "acceleration_rms_m_s2": ("acceleration, rms", "m/s²"),
    "jerk_rms_m_s3": ("jerk, rms", "m/s³"),
    "braking_share": ("share of time braking", "%"),
    "mean_gap_m": ("mean gap", "m"),
    "least_gap_m": ("least gap", "m"),
    "median_time_gap_s": ("median time gap", "s"),
    "least_time_gap_s": ("least time gap", "s"),
    "fuel_l_per_100_km": ("fuel", "l/100 km"),
}


@dataclass(frozen=True)
class Difference:
    """Difference of a side from the first one over their common time; `gap` is None if one of them has none.

    `speed_fit` is 100 (1 - rms of the difference / standard deviation of the first one's speed), in percent,
    as in system identification: 100 is equal, 0 no better than a constant speed.
    """

    shared_s: float
    speed_mean_m_s: float
    speed_rms_m_s: float
    speed_fit: float
    acceleration_rms_m_s2: float
    gap_rms_m: float | None


APART = {  # how people read these
    "shared_s": ("time together", "s"),
    "speed_mean_m_s": ("speed, mean", "m/s"),
    "speed_rms_m_s": ("speed, rms", "m/s"),
    "speed_fit": ("speed, fit", "%"),
    "acceleration_rms_m_s2": ("acceleration, rms", "m/s²"),
    "gap_rms_m": ("gap, rms", "m"),
}


def of(side: Side) -> Statistics:
    """The statistics of one side. Acceleration and jerk are means over the side's step."""
    speed = side.columns["speed"]
    change = np.diff(speed) / side.step_s
    way = float(side.distance[-1])
    known = {name: x[np.isfinite(x)] for name, x in side.columns.items() if np.isfinite(x).any()}
    gap, fuel, brake = (known.get(name) for name in ("gap", "fuel_rate", "brake_command"))
    gaps = side.columns.get("gap", np.full(len(speed), np.nan))
    use = np.isfinite(gaps) & (speed > ROLLING)
    behind = gaps[use] / speed[use]
    burnt = None if fuel is None or way < 1.0 else float(np.sum(fuel)) * side.step_s
    return Statistics(
        duration_s=float(np.isfinite(speed).sum()) * side.step_s,
        distance_m=way,
        mean_speed_m_s=float(np.nanmean(speed)),
        highest_speed_m_s=float(np.nanmax(speed)),
        acceleration_rms_m_s2=_rms(change),
        jerk_rms_m_s3=_rms(np.diff(change) / side.step_s),
        braking_share=None
        if brake is None
        else float(np.mean(brake > max(BRAKES * float(brake.max()), 1e-9))),
        mean_gap_m=None if gap is None else float(np.mean(gap)),
        least_gap_m=None if gap is None else float(np.min(gap)),
        median_time_gap_s=float(np.median(behind)) if len(behind) else None,
        least_time_gap_s=float(np.min(behind)) if len(behind) else None,
        fuel_l_per_100_km=None if burnt is None else burnt / way * LITRES_100_KM,
    )


def difference(first: Side, other: Side, offset_s: float) -> Difference | None:
    """Difference of `other`, shifted by `offset_s`, from `first`; None without common time."""
    time: Array = first.step_s * np.arange(len(first), dtype=np.float64)
    moved: Array = offset_s + other.step_s * np.arange(len(other), dtype=np.float64)
    speed = _at(time, moved, other.columns["speed"]) - first.columns["speed"]
    if not np.isfinite(speed).any():
        return None
    spread = float(np.std(first.columns["speed"][np.isfinite(speed)]))
    own, theirs = (np.gradient(s.columns["speed"], s.step_s) for s in (first, other))
    return Difference(
        shared_s=float(np.isfinite(speed).sum()) * first.step_s,
        speed_mean_m_s=float(np.nanmean(speed)),
        speed_rms_m_s=_rms(speed),
        speed_fit=100.0 * (1.0 - _rms(speed) / spread) if spread > 0.0 else 0.0,
        acceleration_rms_m_s2=_rms(_at(time, moved, theirs) - own),
        gap_rms_m=_gap(first, other, time, moved),
    )


def _gap(first: Side, other: Side, time: Array, moved: Array) -> float | None:
    if "gap" not in first.columns or "gap" not in other.columns:
        return None
    apart = _at(time, moved, other.columns["gap"]) - first.columns["gap"]
    return _rms(apart) if np.isfinite(apart).any() else None


def _at(time: Array, moved: Array, values: Array) -> Array:
    """Values interpolated to other times; NaN outside, and next to unknown values."""
    return np.asarray(np.interp(time, moved, values, left=np.nan, right=np.nan))


def _rms(x: Array) -> float:
    known = x[np.isfinite(x)]
    return float(np.sqrt(np.mean(known**2))) if len(known) else 0.0
