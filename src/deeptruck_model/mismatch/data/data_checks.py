"""Check the data before the truck: what is rejected and why, and faults that show between sensors alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from deeptruck_model.mismatch.data.kinematics import compare, derivative
from deeptruck_model.recordings import Recording
from deeptruck_model.signals import CHANNELS

Array = NDArray[np.float64]

OFFSET = 0.05  # m/s^2; an ordinary accelerometer mounted by hand is no better
SLOPE = 0.03  # relative
LAG_S = 0.3  # filters of ordinary sensors reach this
CERTAIN = 5.0  # standard errors
IMPOSSIBLE = 12.0  # m/s^2; no truck does this
BRAKES, SLOWS = -1.2, -0.5  # m/s^2 over a second: surely braking; no coasting on most roads
STUCK = "brake_command never moves in a drive in which the truck brakes: was it recorded?"


@dataclass(frozen=True)
class Rejection:
    """Samples that were set aside by one rule."""

    rule: str
    samples: int


@dataclass(frozen=True)
class SensorFault:
    """A fault of measurement: effect name, its size with standard error and unit, and one sentence."""

    effect: str
    value: float
    se: float
    unit: str
    says: str


def clean(recordings: Sequence[Recording]) -> tuple[list[Recording], list[Rejection]]:
    """Recordings with impossible samples made NaN, and how many went by which rule."""
    counts: dict[str, int] = {}
    out = []
    for r in recordings:
        channels = {name: x.copy() for name, x in r.channels.items()}
        for name, x in channels.items():
            low, high = CHANNELS[name].low, CHANNELS[name].high
            _reject(
                x,
                (x < low) | (x > high),
                f"{name} outside {low:g} .. {high:g} {r.interface.unit(name)}",
                counts,
            )
        speed = channels["speed"]
        jump = np.abs(derivative(speed, r.dt)) > IMPOSSIBLE
        _reject(speed, jump, f"speed jumps by more than {IMPOSSIBLE:g} m/s^2", counts)
        if "brake_command" in r.interface.u:
            _reject(channels["brake_command"], _unrecorded_braking(r, speed), STUCK, counts)
        for name in ("speed", *r.interface.u, *r.interface.w):
            missing = int(np.isnan(r.channels[name]).sum())
            if missing:
                counts[f"{name} missing or invalid"] = counts.get(f"{name} missing or invalid", 0) + missing
        out.append(replace(r, channels=channels))
    return out, [Rejection(rule, n) for rule, n in sorted(counts.items(), key=lambda item: -item[1])]


def _reject(x: Array, bad: NDArray[np.bool_], rule: str, counts: dict[str, int]) -> None:
    if bad.any():
        counts[rule] = counts.get(rule, 0) + int(bad.sum())
        x[bad] = np.nan


def _unrecorded_braking(r: Recording, speed: Array) -> NDArray[np.bool_]:
    """Where the truck slows (n,), if it brakes though its brake command never moves."""
    command = r.channels["brake_command"]
    slowing = uniform_filter1d(np.nan_to_num(derivative(speed, r.dt)), max(round(1.0 / r.dt), 1))
    never_moves = np.isfinite(command).any() and np.nanmin(command) == np.nanmax(command)
    braked: NDArray[np.bool_] = (slowing < SLOWS) & bool(never_moves and (slowing < BRAKES).any())
    return braked


def acceleration_is_measured(recordings: Sequence[Recording]) -> bool:
    """Whether the acceleration channel is a sensor of its own and not the derivative of speed."""
    for r in recordings:
        a, d = r.channels["acceleration"], derivative(r.channels["speed"], r.dt)
        both = np.isfinite(a) & np.isfinite(d)
        for shifted in (d, np.roll(d, 1), np.roll(d, -1), (d + np.roll(d, -1)) / 2):
            known = both & np.isfinite(shifted)
            if known.sum() > 20 and np.median(np.abs(a - shifted)[known]) < 1e-6:
                return False
    return any(np.isfinite(r.channels["acceleration"]).sum() > 50 for r in recordings)


def sensor_faults(recordings: Sequence[Recording]) -> list[SensorFault]:
    """Faults between speed and accelerometer, pooled over the recordings. No truck model enters."""
    seen = [compare(r.channels["speed"], r.channels["acceleration"], r.dt) for r in recordings]
    seen = [k for k in seen if np.isfinite(k.slope)]
    if not seen:
        return []
    offset, offset_se = _pool([k.offset for k in seen], [k.offset_se for k in seen])
    slope, slope_se = _pool([k.slope for k in seen], [k.slope_se for k in seen])
    lag, lag_se = _pool([k.lag_s for k in seen], [k.lag_se for k in seen])
    faults = []
    if abs(offset) > OFFSET and abs(offset) > CERTAIN * offset_se:
        says = f"the accelerometer is {offset:+.3f} m/s^2 off the derivative of speed whatever happens"
        faults.append(SensorFault("acceleration_bias", offset, offset_se, "m/s^2", says))
    if abs(slope - 1) > SLOPE and abs(slope - 1) > CERTAIN * slope_se:
        says = (
            f"speed changes {1 / slope:.3f} times as much as the accelerometer says: one of the two is scaled"
        )
        faults.append(SensorFault("speed_scale", 1 / slope, slope_se / slope**2, "1", says))
    if abs(lag) > LAG_S and abs(lag) > CERTAIN * lag_se:
        says = f"acceleration is stamped {lag:+.2f} s against speed"
        faults.append(SensorFault("clock_offset", lag, lag_se, "s", says))
    return faults


def mended(r: Recording, faults: Sequence[SensorFault]) -> Recording:
    """The recording without the sensor faults found, so that they are not taken for physics.

    Scale is put on the speed and lag on the accelerometer; an offset of the accelerometer never enters (see
    kinematics).
    """
    channels = dict(r.channels)
    for fault in faults:
        if fault.effect == "speed_scale":
            channels["speed"] = channels["speed"] / fault.value
        elif fault.effect == "clock_offset":
            t = np.arange(len(r)) * r.dt
            channels["acceleration"] = np.interp(t + fault.value, t, np.nan_to_num(channels["acceleration"]))
    return replace(r, channels=channels)


def _pool(values: Sequence[float], errors: Sequence[float]) -> tuple[float, float]:
    """Weighted mean over recordings; its error is at least what the recordings scatter by."""
    v, w = np.array(values), 1.0 / np.maximum(np.array(errors), 1e-6) ** 2
    mean = float(np.average(v, weights=w))
    spread = (
        float(np.sqrt(np.average((v - mean) ** 2, weights=w) / max(len(v) - 1, 1))) if len(v) > 1 else 0.0
    )
    return mean, max(float(1.0 / np.sqrt(w.sum())), spread)
