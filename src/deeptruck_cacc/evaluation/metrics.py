"""Statistics of rollouts."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from deeptruck_cacc.controllers.pedals import PedalMap
from deeptruck_cacc.environments.rollouts import Trace
from deeptruck_cacc.environments.scenes import Scene
from deeptruck_core.arrays import Array
from deeptruck_core.constants import ROUNDED_GRAVITY

EACH = "time_gap_worst_each_within_reach"  # s, a number for each rollout


def over_time(values: Array) -> dict[str, Array]:
    """Mean, sd, min and max over the rollouts at each time, from (T, batch)."""
    return {
        "mean": values.mean(axis=1),
        "sd": values.std(axis=1),
        "min": values.min(axis=1),
        "max": values.max(axis=1),
    }


def error(values: Array) -> dict[str, float]:
    """Statistics of a residual error, (T, batch): bias, sd, extremes, mean and worst magnitude, 99 %
    quantile."""
    size = np.abs(values)
    return {
        "mean": float(values.mean()),
        "sd": float(values.std()),
        "min": float(values.min()),
        "max": float(values.max()),
        "mean_abs": float(size.mean()),
        "p99_abs": float(np.quantile(size, 0.99)),
        "worst_abs": float(size.max()),
        "mean_shift": float(abs(values.mean())),
    }


def settling_time(trace: Trace, time_gap_s: float, speed: float) -> Array:
    """Time (batch,), s, after which the time-gap error stays within ±`time_gap_s` and the speed error within
    ±`speed` (m/s); inf if they never do."""
    outside = (np.abs(trace["time_gap_error"]) > time_gap_s) | (np.abs(trace["speed_error"]) > speed)
    last = len(outside) - 1 - np.argmax(outside[::-1], axis=0)
    last = np.where(outside.any(axis=0), last + 1, 0)
    return np.where(last < len(outside), trace.dt * last, np.inf)


def within_reach(scene: Scene, pedals: PedalMap, dt: float) -> NDArray[np.bool_]:
    """When the truck could have kept the time gap, (T, batch); depends on the scene and not on the policy.

    The ideal follower v' = (v_leader - v) / Tg is within reach if it needs no more than full engine power on
    that grade; a phase that is out of reach also excludes the following 10 s.
    """
    pull = np.cumsum(scene.leader_acceleration.T, axis=0) * dt
    leader, speed = np.maximum(scene.leader_speed + pull, 0.0), scene.speed.copy()
    out = np.zeros(leader.shape, bool)
    since = np.full(scene.batch, np.inf)
    for k, now in enumerate(leader):
        wanted = (now - speed) / scene.time_gap
        full = np.interp(speed, pedals.speed, pedals.full) - ROUNDED_GRAVITY * scene.grade[:, k]
        since = np.where(wanted > full, 0.0, since + dt)
        out[k] = since > 10.0
        speed = speed + dt * wanted
    return out


def brake_pulses_per_h(trace: Trace) -> float:
    """How often an hour the brake is applied: it wears, and is no means of fine control."""
    pressed = trace["brake_command"] > 0.0
    begins = pressed[1:] & ~pressed[:-1]
    return float(begins.sum() / (begins.size * trace.dt / 3600.0))


def summary(trace: Trace, reach: NDArray[np.bool_] | None = None) -> dict[str, Any]:
    """Errors after the paper's times, safety, comfort and fuel of a set of rollouts.

    With `reach` (T, batch) also the worst time-gap error at times when the truck had enough power to avoid
    it, its 99 % quantile, the worst of each rollout, and the number of rollouts in which it stayed within 0.1
    s.
    """
    late, steady = round(10.0 / trace.dt), round(25.0 / trace.dt)
    distance_km = float(trace["speed"].sum() * trace.dt / 1e3)
    litres = float(trace["fuel"].sum() * trace.dt / 1e3)
    moving = trace["speed"][late:] > 1.0
    time_gap = np.where(moving, trace["time_gap_error"][late:], 0.0)
    row: dict[str, Any] = {
        "rollouts": trace.scene.batch,
        "time_gap_error_after_10s": error(time_gap),
        "speed_error_after_25s": error(trace["speed_error"][steady:]),
        "crashes": int(trace["crash"].any(axis=0).sum()),
        "min_gap_m": float(trace["gap"].min()),
        "min_ttc_s": float(trace["ttc"].min()),
        "acceleration_rms": float(np.sqrt(np.mean(trace["acceleration"] ** 2))),
        "jerk_rms": float(np.sqrt(np.mean(trace["jerk"] ** 2))),
        "brake_pulses_per_h": brake_pulses_per_h(trace),
        "fuel_l_per_100km": 100.0 * litres / distance_km if np.isfinite(litres) else None,
        "shield_share": float(trace["acted"].mean()),
        "mean_return": float(trace["reward"].sum(axis=0).mean()),
    }
    if reach is not None and reach[late:].any():
        size = np.abs(time_gap)
        row["time_gap_worst_within_reach"] = float(size[reach[late:]].max())
        row["time_gap_p99_within_reach"] = float(np.quantile(size[reach[late:]], 0.99))
        each = np.where(reach[late:], size, 0.0).max(axis=0)
        row[EACH] = each.tolist()
        row["rollouts_within_0.1_s"] = int((each <= 0.1).sum())
        row["share_within_reach"] = float(reach[late:].mean())
    return row
