"""Sensors of the fifth world: wheel pulses, a shaken box, slopes of a satellite receiver, gaps in the log."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
from scipy.signal import lfilter

from deeptruck_exam.hidden import Array, ou_series
from deeptruck_exam.sensors import KMH, LPH, RPM, quantise


@dataclass(frozen=True)
class Harness:
    """One truck's. Resolutions after SAE J1939-71, coarser where loggers pack their data."""

    speed_lag_s: float
    speed_noise: float
    acceleration_width: int  # samples of a running mean
    acceleration_noise: float
    acceleration_step: float
    bias: float
    bias_walk: float  # m/s2 in a minute
    grade_every: int
    grade_lag_s: float
    grade_noise: float
    grade_bias: float
    torque_step: float
    torque_noise: float
    fuel_lag_s: float
    pedal_step: float
    gaps: float  # in a minute

    @staticmethod
    def draw(rng: np.random.Generator) -> Harness:
        return Harness(
            speed_lag_s=rng.uniform(0.04, 0.13),
            speed_noise=rng.uniform(0.006, 0.02),
            acceleration_width=int(rng.choice([1, 2, 3])),
            acceleration_noise=rng.uniform(0.025, 0.07),
            acceleration_step=float(rng.choice([0.01, 0.05, 0.1])),
            bias=rng.normal(0.0, 0.004),
            bias_walk=rng.uniform(0.0005, 0.0025),
            grade_every=int(rng.choice([1, 2, 5, 10])),
            grade_lag_s=rng.uniform(0.05, 0.4),
            grade_noise=rng.uniform(0.0005, 0.0016),
            grade_bias=rng.normal(0.0, 0.0004),
            torque_step=float(rng.choice([1.0, 0.5, 0.125])),
            torque_noise=rng.uniform(0.002, 0.006),
            fuel_lag_s=rng.uniform(0.02, 0.2),
            pedal_step=float(rng.choice([0.4, 0.1])),
            gaps=rng.uniform(0.0, 1.5),
        )


def behind(values: Array, time_constant: float, dt: float) -> Array:
    """First-order lag from rest at the first value."""
    keep = np.exp(-dt / max(time_constant, 1e-3))
    return np.asarray(lfilter([1.0 - keep], [1.0, -keep], values, zi=[values[0] * keep])[0])


def joined(values: Array, every: int, first: int) -> Array:
    """Messages slower than the log, joined by straight lines as loggers that resample do."""
    at = np.arange(len(values))
    known = np.unique(np.append(at[first % every :: every], [0, len(values) - 1]))
    return np.interp(at, known, values[known])


def record(
    true: dict[str, Array],
    sensors: Harness | None,
    truck: SimpleNamespace,
    dt: float,
    rng: np.random.Generator,
) -> dict[str, Array]:
    """One recording's channels (n,) as measured; without sensors as they were. `distance` is never
    recorded."""
    channels = {name: values.copy() for name, values in true.items() if name != "distance"}
    if sensors is None:
        return channels
    _motion(channels, sensors, dt, rng)
    _slope(channels, sensors, dt, rng)
    _machine(channels, sensors, truck, dt, rng)
    _gaps(channels, sensors, dt, rng)
    return channels


def _motion(channels: dict[str, Array], one: Harness, dt: float, rng: np.random.Generator) -> None:
    true = channels["speed"]
    n = len(true)
    speed = behind(true, one.speed_lag_s, dt) + one.speed_noise * rng.standard_normal(n)
    # at walking pace the pulses of a wheel come too rarely to count
    speed = np.where(true < 0.25, 0.0, speed)
    channels["speed"] = np.maximum(quantise(speed, KMH / 256.0), 0.0)
    shakes = one.acceleration_noise * (0.5 + 0.5 * np.clip(true / 18.0, 0.0, 1.4))
    felt = channels["acceleration"] + shakes * rng.standard_t(5.0, n) / np.sqrt(5.0 / 3.0)
    felt = np.convolve(np.pad(felt, (one.acceleration_width - 1, 0), mode="edge"), _mean(one), mode="valid")
    walk = np.cumsum(rng.standard_normal(n)) * one.bias_walk * np.sqrt(dt / 60.0)
    channels["acceleration"] = quantise(felt + one.bias + walk, one.acceleration_step)


def _mean(one: Harness) -> Array:
    return np.full(one.acceleration_width, 1.0 / one.acceleration_width)


def _slope(channels: dict[str, Array], one: Harness, dt: float, rng: np.random.Generator) -> None:
    n = len(channels["grade"])
    noisy = behind(channels["grade"], one.grade_lag_s, dt) + one.grade_bias
    noisy = noisy + one.grade_noise * ou_series(rng, (1, n), dt, 3.5)[0]
    channels["grade"] = quantise(joined(noisy, one.grade_every, int(rng.integers(10))), 0.0002)
    height = channels["elevation"] + rng.uniform(0.3, 0.8) * ou_series(rng, (1, n), dt, 45.0)[0]
    channels["elevation"] = quantise(joined(height, 10, int(rng.integers(10))), 0.125)


def _machine(
    channels: dict[str, Array], one: Harness, truck: SimpleNamespace, dt: float, rng: np.random.Generator
) -> None:
    n = len(channels["speed"])
    flow = behind(channels["fuel_rate"], one.fuel_lag_s, dt) * (1.0 + 0.01 * rng.standard_normal(n))
    channels["fuel_rate"] = quantise(np.maximum(flow, 0.0), 0.05 * LPH)
    turns = channels["engine_speed"] + 0.25 * rng.standard_normal(n)
    channels["engine_speed"] = quantise(turns, 0.125 * RPM)
    percent = truck.reference_torque / 100.0
    shaft = channels["engine_torque"] + 100.0 * one.torque_noise * percent * rng.standard_normal(n)
    channels["engine_torque"] = quantise(shaft, one.torque_step * percent)
    step = one.torque_step * percent / truck.command_scale
    channels["engine_command"] = quantise(channels["engine_command"], step)
    pedal = 1.0 / 2048.0 if truck.by_deceleration else one.pedal_step
    channels["brake_command"] = quantise(channels["brake_command"], pedal)


def _gaps(channels: dict[str, Array], one: Harness, dt: float, rng: np.random.Generator) -> None:
    """Bursts in which the bus was too full: all slow messages keep their last value for half a second."""
    n = len(channels["speed"])
    stale = np.zeros(n, bool)
    for first in rng.integers(1, n, int(rng.poisson(one.gaps * n * dt / 60.0))):
        stale[first : first + int(rng.integers(1, 6))] = True
    last = np.maximum.accumulate(np.where(stale, 0, np.arange(n)))
    for name in ("fuel_rate", "engine_speed", "engine_torque", "acceleration"):
        channels[name] = channels[name][last]
