"""Sensors of the fourth world: other control units, other filters, slower messages."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
from scipy.signal import butter, lfilter, lfilter_zi

from deeptruck_exam.hidden import Array, ou_series
from deeptruck_exam.sensors import KMH, LPH, RPM, quantise


@dataclass(frozen=True)
class Instruments:
    """One truck's. Resolutions after SAE J1939-71: the stability unit's acceleration (VDC2) has 0.1 m/s2 or,
    in the extended message, 1/2048 m/s2; pitch from the gearbox's inclination sensor; torque in 1/8 %
    where EEC1 carries the fraction (SPN 4154)."""

    speed_hz: float
    speed_noise: float
    acceleration_hz: float
    acceleration_noise: float
    acceleration_step: float
    acceleration_bias: float
    grade_noise: float
    grade_bias: float
    grade_every_s: float
    grade_step: float
    torque_step: float
    fuel_every_s: float
    fuel_noise: float
    height_noise: float
    lost: float

    @staticmethod
    def draw(rng: np.random.Generator) -> Instruments:
        return Instruments(
            speed_hz=rng.uniform(1.8, 4.0),
            speed_noise=rng.uniform(0.008, 0.03),
            acceleration_hz=rng.uniform(2.0, 5.0),
            acceleration_noise=rng.uniform(0.03, 0.08),
            acceleration_step=float(rng.choice([0.1, 0.02, 1.0 / 2048.0])),
            acceleration_bias=rng.normal(0.0, 0.004),
            grade_noise=rng.uniform(0.0006, 0.0018),
            grade_bias=rng.normal(0.0, 0.0004),
            grade_every_s=float(rng.choice([0.1, 0.2, 0.5])),
            grade_step=float(rng.choice([0.0001, 0.0005, 0.001])),
            torque_step=float(rng.choice([1.0, 0.125])),
            fuel_every_s=float(rng.choice([0.1, 0.2])),
            fuel_noise=rng.uniform(0.006, 0.016),
            height_noise=rng.uniform(0.3, 0.9),
            lost=rng.uniform(0.0005, 0.004),
        )


def low_pass(values: Array, hertz: float, dt: float) -> Array:
    """Second-order Butterworth, as anti-alias filters are."""
    b, a = butter(2, hertz, fs=1.0 / dt)
    return np.asarray(lfilter(b, a, values, zi=lfilter_zi(b, a) * values[0])[0])


def hold(values: Array, every_s: float, dt: float, first: int = 0) -> Array:
    """Messages slower than the log: the last one before."""
    every = max(1, round(every_s / dt))
    at = np.arange(len(values))
    return np.asarray(values[np.maximum(at - (at - first) % every, 0)])


def record(
    true: dict[str, Array],
    sensors: Instruments | None,
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
    _machine(channels, sensors, truck, dt, rng)
    for name in ("speed", "acceleration", "fuel_rate", "engine_speed", "engine_torque"):
        channels[name] = _lost(channels[name], sensors.lost, rng)
    return channels


def _motion(channels: dict[str, Array], one: Instruments, dt: float, rng: np.random.Generator) -> None:
    n = len(channels["speed"])
    true = channels["speed"]
    speed = low_pass(true, one.speed_hz, dt) + one.speed_noise * ou_series(rng, (1, n), dt, 0.15)[0]
    speed = np.where(true > 0.3, speed, np.where(true > 0.0, np.minimum(speed, 0.3), 0.0))
    channels["speed"] = np.maximum(quantise(speed, KMH / 256.0), 0.0)
    # the road shakes a box as its own vibration does, in proportion to a power of speed
    shakes = one.acceleration_noise * (0.4 + 0.6 * np.sqrt(np.clip(true / 20.0, 0.0, 1.5)))
    felt = channels["acceleration"] + shakes * rng.standard_normal(n) * 1.6
    felt = low_pass(felt, one.acceleration_hz * 0.9, dt) + one.acceleration_bias
    channels["acceleration"] = quantise(felt, one.acceleration_step)
    slope = channels["grade"] + one.grade_noise * ou_series(rng, (1, n), dt, 2.5)[0] + one.grade_bias
    channels["grade"] = quantise(hold(slope, one.grade_every_s, dt, int(rng.integers(5))), one.grade_step)
    height = channels["elevation"] + one.height_noise * ou_series(rng, (1, n), dt, 60.0)[0]
    channels["elevation"] = quantise(hold(height, 1.0, dt), 0.125)


def _machine(
    channels: dict[str, Array],
    one: Instruments,
    truck: SimpleNamespace,
    dt: float,
    rng: np.random.Generator,
) -> None:
    n = len(channels["speed"])
    flow = channels["fuel_rate"] * (1.0 + one.fuel_noise * ou_series(rng, (1, n), dt, 0.6)[0])
    channels["fuel_rate"] = quantise(hold(np.maximum(flow, 0.0), one.fuel_every_s, dt), 0.05 * LPH)
    turns = channels["engine_speed"] + 0.35 * rng.standard_normal(n)
    channels["engine_speed"] = quantise(turns, 0.125 * RPM)
    percent = truck.reference_torque / 100.0
    shaft = channels["engine_torque"] + 0.4 * percent * ou_series(rng, (1, n), dt, 0.9)[0]
    channels["engine_torque"] = quantise(shaft, one.torque_step * percent)
    step = one.torque_step * percent / truck.command_scale
    channels["engine_command"] = quantise(channels["engine_command"], step)
    pedal = 1.0 / 2048.0 if truck.by_deceleration else 0.4
    channels["brake_command"] = quantise(channels["brake_command"], pedal)


def _lost(values: Array, share: float, rng: np.random.Generator) -> Array:
    """Messages that did not come, one by one; the last one before is logged again."""
    lost = rng.random(len(values)) < share
    lost[0] = False
    last = np.maximum.accumulate(np.where(lost, 0, np.arange(len(values))))
    return np.asarray(values[last])
