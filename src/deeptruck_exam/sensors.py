"""What a real truck records: SAE J1939 resolutions, noise, low-pass filters, a jittering clock, missing
channels."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
from scipy.signal import lfilter

from deeptruck_exam.hidden import Array, ou_series

KMH, RPM, LPH = 1.0 / 3.6, np.pi / 30.0, 1.0 / 3.6  # m/s, rad/s, cm3/s


@dataclass(frozen=True)
class Sensors:
    """Standard deviations and resolutions of one truck's sensors (SI). Resolutions: SAE J1939-71, SPN 84
    speed, SPN 190 engine speed, SPN 513 torque, SPN 183 fuel, SPN 521 brake pedal, SPN 580 altitude."""

    speed_noise: float = 0.02
    speed_lag_s: float = 0.08
    acceleration_noise: float = 0.05
    acceleration_bias: float = 0.004
    grade_noise: float = 0.0012
    grade_bias: float = 0.0004
    fuel_noise: float = 0.01
    torque_noise: float = 0.005
    jitter_s: float = 0.004
    elevation_noise: float = 0.4

    @staticmethod
    def draw(rng: np.random.Generator) -> Sensors:
        def about(value: float) -> float:
            return float(value * rng.uniform(0.6, 1.6))

        return Sensors(
            about(0.02),
            float(rng.uniform(0.03, 0.12)),
            about(0.05),
            float(rng.normal(0.0, 0.004)),
            about(0.0012),
            float(rng.normal(0.0, 0.0004)),
            about(0.01),
            about(0.005),
            about(0.004),
            about(0.4),
        )


def quantise(values: Array, step: float) -> Array:
    return np.asarray(np.rint(values / step) * step)


def _low_pass(values: Array, time_constant: float, dt: float) -> Array:
    keep = np.exp(-dt / time_constant)
    start = values[0] * keep
    return np.asarray(lfilter([1.0 - keep], [1.0, -keep], values, zi=[start])[0])


def record(
    true: dict[str, Array],
    sensors: Sensors | None,
    truck: SimpleNamespace,
    dt: float,
    rng: np.random.Generator,
) -> dict[str, Array]:
    """One recording's channels (n,) as measured; without sensors as they were. `distance` is never
    recorded."""
    channels = {name: values.copy() for name, values in true.items() if name != "distance"}
    if sensors is None:
        return channels
    n = len(channels["speed"])
    late = sensors.jitter_s * rng.standard_normal(n)
    clock = np.arange(n) * dt
    for name in ("speed", "acceleration", "engine_command", "brake_command", "fuel_rate"):
        channels[name] = np.interp(clock + late, clock, channels[name])
    white = rng.standard_normal
    speed = _low_pass(channels["speed"], sensors.speed_lag_s, dt)
    speed = np.where(channels["speed"] > 0.2, speed + sensors.speed_noise * white(n), channels["speed"])
    channels["speed"] = np.maximum(quantise(speed, KMH / 256.0), 0.0)
    shaken = channels["acceleration"] + sensors.acceleration_noise * white(n) + sensors.acceleration_bias
    channels["acceleration"] = quantise(shaken, 0.01)
    slope = channels["grade"] + sensors.grade_noise * ou_series(rng, (1, n), dt, 1.5)[0] + sensors.grade_bias
    channels["grade"] = quantise(slope, 0.0005)
    channels["elevation"] = quantise(
        channels["elevation"] + sensors.elevation_noise * ou_series(rng, (1, n), dt, 10.0)[0], 0.125
    )
    flow = np.maximum(channels["fuel_rate"] * (1.0 + sensors.fuel_noise * white(n)), 0.0)
    channels["fuel_rate"] = quantise(flow, 0.05 * LPH)
    channels["engine_speed"] = quantise(channels["engine_speed"] + 0.2 * white(n), 0.125 * RPM)
    percent = truck.reference_torque / 100.0
    shaft = channels["engine_torque"] + sensors.torque_noise * truck.reference_torque * white(n)
    channels["engine_torque"] = quantise(shaft, percent)
    channels["engine_command"] = quantise(channels["engine_command"], percent / truck.command_scale)
    channels["brake_command"] = quantise(
        channels["brake_command"], 1.0 / 2048.0 if truck.by_deceleration else 0.4
    )
    return channels
