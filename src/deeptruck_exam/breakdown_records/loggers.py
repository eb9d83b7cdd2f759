"""Sensors of the sixth world: the fifth's chain with other sizes, before a box on a mobile network."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np

from deeptruck_exam.fleet_trials import harness
from deeptruck_exam.fleet_trials.harness import Harness, joined
from deeptruck_exam.hidden import Array
from deeptruck_exam.sensors import KMH, quantise

SLOW = ("engine_speed", "engine_torque", "fuel_rate")


@dataclass(frozen=True)
class Logger(Harness):
    """`runout` of a tone ring, once a turn of the wheel; `engine_every`: samples between two messages that
    the box asks the engine for; `spikes` in a minute of a bracket that knocks; `outages` in a minute."""

    runout: float
    engine_every: int
    spikes: float
    outages: float

    @staticmethod
    def draw(rng: np.random.Generator) -> Logger:
        return Logger(
            speed_lag_s=rng.uniform(0.06, 0.2),
            speed_noise=rng.uniform(0.004, 0.012),
            acceleration_width=int(rng.choice([2, 4, 5])),
            acceleration_noise=rng.uniform(0.04, 0.09),
            acceleration_step=float(rng.choice([0.02, 0.05, 1.0 / 64.0])),
            bias=rng.normal(0.0, 0.005),
            bias_walk=rng.uniform(0.001, 0.003),
            grade_every=int(rng.choice([2, 5, 10])),
            grade_lag_s=rng.uniform(0.1, 0.5),
            grade_noise=rng.uniform(0.0006, 0.0018),
            grade_bias=rng.normal(0.0, 0.0005),
            torque_step=float(rng.choice([1.0, 0.5])),
            torque_noise=rng.uniform(0.003, 0.008),
            fuel_lag_s=rng.uniform(0.05, 0.3),
            pedal_step=0.4,
            gaps=rng.uniform(0.5, 2.5),
            runout=rng.uniform(0.0005, 0.002),
            engine_every=int(rng.choice([1, 2, 3])),
            spikes=rng.uniform(0.0, 3.0),
            outages=rng.uniform(0.0, 0.8),
        )


def record(
    true: dict[str, Array],
    sensors: Logger | None,
    truck: SimpleNamespace,
    dt: float,
    rng: np.random.Generator,
) -> dict[str, Array]:
    """One recording's channels (n,) as measured; without sensors as they were. `distance` is never
    recorded."""
    channels = harness.record(true, sensors, truck, dt, rng)
    if sensors is None:
        return channels
    n = len(channels["speed"])
    turns = true["distance"] / truck.wheel_radius + rng.uniform(0.0, 2.0 * np.pi)
    channels["speed"] = quantise(channels["speed"] * (1.0 + sensors.runout * np.sin(turns)), KMH / 256.0)
    for name in SLOW:
        channels[name] = joined(channels[name], sensors.engine_every, int(rng.integers(6)))
    knocks = rng.random(n) < sensors.spikes * dt / 60.0
    channels["acceleration"] = channels["acceleration"] + knocks * rng.normal(0.0, 0.5, n)
    _outages(channels, sensors, dt, rng)
    return channels


def _outages(channels: dict[str, Array], one: Logger, dt: float, rng: np.random.Generator) -> None:
    """Moments in which the box sent nothing: what reads it joins both ends by a line."""
    n = len(channels["speed"])
    lost = np.zeros(n, bool)
    for first in rng.integers(1, n, int(rng.poisson(one.outages * n * dt / 60.0))):
        lost[first : first + int(rng.integers(2, 9))] = True
    lost[-1] = False
    at = np.arange(n)
    for name in ("acceleration", "grade", *SLOW):
        channels[name] = np.interp(at, at[~lost], channels[name][~lost])
