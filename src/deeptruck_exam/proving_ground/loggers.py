"""Loggers of the seventh world: every message has a period and a latency of its own, and is held until the
next one has come."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
from scipy.signal import butter, lfilter, lfilter_zi

from deeptruck_exam.fleet_trials.harness import behind
from deeptruck_exam.hidden import Array, ou_series
from deeptruck_exam.sensors import KMH, LPH, RPM, quantise

ON_THE_BUS = ("speed", "acceleration", "engine_speed", "engine_torque", "fuel_rate")


def draw(rng: np.random.Generator) -> SimpleNamespace:
    """A truck's. `late_s`: latency of a message at most; `skips`: share of messages that lose arbitration;
    `slow`: samples between messages of the engine; `cut_hz` of the inertial box's filter; `shakes` m/s2 of
    the rolling truck; `warms` m/s2 in a drive."""
    return SimpleNamespace(
        late_s=rng.uniform(0.01, 0.06),
        skips=rng.uniform(0.0, 0.03),
        slow=int(rng.choice([1, 1, 2])),
        speed_lag_s=rng.uniform(0.05, 0.15),
        speed_noise=rng.uniform(0.004, 0.015),
        cut_hz=rng.uniform(1.5, 4.0),
        shakes=rng.uniform(0.04, 0.10),
        bias=rng.normal(0.0, 0.005),
        warms=rng.normal(0.0, 0.004),
        acceleration_step=float(rng.choice([0.01, 0.0125, 0.05])),
        grade_noise=rng.uniform(0.0005, 0.0016),
        grade_bias=rng.normal(0.0, 0.0005),
        grade_every=int(rng.choice([1, 2, 5])),
        grade_step=float(rng.choice([0.0002, 0.0005, 0.001])),
        torque_step=float(rng.choice([1.0, 0.125])),
        torque_noise=rng.uniform(0.002, 0.007),
        fuel_noise=rng.uniform(0.005, 0.02),
    )


def heard(values: Array, every: int, skips: float, rng: np.random.Generator) -> Array:
    """What a logger holds: the last message that has come, of those sent every so many samples."""
    n = len(values)
    comes = (np.arange(n) + rng.integers(every)) % every == 0
    comes &= rng.random(n) >= skips
    return values[np.maximum.accumulate(np.where(comes, np.arange(n), 0))]


def record(
    true: dict[str, Array],
    sensors: SimpleNamespace | None,
    truck: SimpleNamespace,
    dt: float,
    rng: np.random.Generator,
) -> dict[str, Array]:
    """One recording's channels (n,) as measured; without sensors as they were. `distance` is never
    recorded."""
    channels = {name: values.copy() for name, values in true.items() if name != "distance"}
    if sensors is None:
        return channels
    clock = np.arange(len(channels["speed"])) * dt
    for name in ON_THE_BUS:
        late = sensors.late_s * rng.uniform(0.3, 1.0)
        channels[name] = np.interp(clock - late, clock, channels[name])
    _motion(channels, sensors, dt, rng)
    _machine(channels, sensors, truck, rng)
    return channels


def _motion(channels: dict[str, Array], one: SimpleNamespace, dt: float, rng: np.random.Generator) -> None:
    true = channels["speed"]
    n = len(true)
    speed = behind(true, one.speed_lag_s, dt) + one.speed_noise * ou_series(rng, (1, n), dt, 0.2)[0]
    speed = np.where(true < 0.3, 0.0, speed)  # too few teeth of the ring pass
    channels["speed"] = quantise(heard(np.maximum(speed, 0.0), 1, one.skips, rng), KMH / 256.0)
    shakes = one.shakes * (0.4 + 0.6 * np.clip(true / 22.0, 0.0, 1.2)) * rng.standard_normal(n)
    b, a = butter(2, one.cut_hz * 2.0 * dt)
    felt = channels["acceleration"] + shakes
    felt = lfilter(b, a, felt, zi=lfilter_zi(b, a) * felt[0])[0]
    drift = one.bias + one.warms * (1.0 - np.exp(-np.arange(n) * dt / 90.0))
    channels["acceleration"] = quantise(heard(felt + drift, 1, one.skips, rng), one.acceleration_step)
    noise = one.grade_noise * ou_series(rng, (1, n), dt, 2.0)[0] + one.grade_bias
    channels["grade"] = quantise(heard(channels["grade"] + noise, one.grade_every, 0.0, rng), one.grade_step)
    height = channels["elevation"] + 0.5 * ou_series(rng, (1, n), dt, 30.0)[0]
    channels["elevation"] = quantise(heard(height, 10, 0.0, rng), 0.125)


def _machine(
    channels: dict[str, Array], one: SimpleNamespace, truck: SimpleNamespace, rng: np.random.Generator
) -> None:
    n, white = len(channels["speed"]), rng.standard_normal
    percent = truck.reference_torque / 100.0
    turns = quantise(channels["engine_speed"] + 0.3 * white(n), 0.125 * RPM)
    shaft = channels["engine_torque"] + 100.0 * one.torque_noise * percent * white(n)
    flow = np.maximum(channels["fuel_rate"] * (1.0 + one.fuel_noise * white(n)), 0.0)
    channels["engine_speed"] = heard(turns, one.slow, one.skips, rng)
    channels["engine_torque"] = heard(quantise(shaft, one.torque_step * percent), one.slow, one.skips, rng)
    channels["fuel_rate"] = heard(quantise(flow, 0.05 * LPH), one.slow, one.skips, rng)
    step = one.torque_step * percent / truck.command_scale
    channels["engine_command"] = quantise(channels["engine_command"], step)
    pedal = 1.0 / 2048.0 if truck.by_deceleration else 0.4
    channels["brake_command"] = quantise(channels["brake_command"], pedal)
