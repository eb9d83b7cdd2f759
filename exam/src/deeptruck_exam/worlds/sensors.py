"""Sensors and logger of a truck: filters, noise, slow messages, clock jitter, lost messages."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from deeptruck_core.arrays import Array
from deeptruck_exam.laws.law import Channels
from deeptruck_exam.laws.series import lagged, ou_series

TIMED = ("speed", "acceleration", "engine_command", "brake_command", "fuel_rate")
SLOW = ("acceleration", "fuel_rate", "engine_speed", "engine_torque", "grade")
NO_FAULTS = dict.fromkeys(
    ("jitter_s", "late_s", "lost", "bursts_per_min", "spikes_per_min", "runout"), (0.0, 0.0)
)


@dataclass(frozen=True)
class Sensor:
    """Sensor of one channel, by worlds.yaml."""

    lag_s: float
    noise: float
    colour_s: float
    bias: float
    walk: float
    every: int
    step: float

    @staticmethod
    def draw(values: Mapping[str, Any], rng: np.random.Generator) -> Sensor:
        return Sensor(
            rng.uniform(*values.get("lag_s", (0.0, 0.0))),
            rng.uniform(*values.get("noise", (0.0, 0.0))),
            values.get("colour_s", 0.0),
            rng.normal(0.0, values.get("bias", 0.0)),
            rng.uniform(*values.get("walk", (0.0, 0.0))),
            int(rng.choice(values.get("every", (1,)))),
            float(rng.choice(values.get("step", (0.0,)))),
        )


@dataclass(frozen=True)
class Sensors:
    """Sensors of one truck: each channel's sensor, and the faults of clock and bus (see worlds.yaml)."""

    of: Mapping[str, Sensor]
    pedal_step: float
    jitter_s: float
    late_s: float
    lost: float
    bursts_per_min: float
    spikes_per_min: float
    runout: float

    @staticmethod
    def draw(values: Mapping[str, Any], rng: np.random.Generator) -> Sensors:
        """Draw sensors of a random quality class; `values` is `sensors` of worlds.yaml."""
        names = sorted(values["classes"])
        one = dict(values["classes"][names[rng.integers(len(names))]])
        faults = {name: rng.uniform(*span) for name, span in {**NO_FAULTS, **one.pop("clock", {})}.items()}
        each = {name: Sensor.draw(v, rng) for name, v in {**values["usual"], **one}.items()}
        each["specific_force"] = each["acceleration"]
        return Sensors(each, values["pedal_step_percent"], **faults)

    def record(self, true: Channels, truck: SimpleNamespace, dt: float, rng: np.random.Generator) -> Channels:
        """One recording's channels (n,) as measured. `distance` is never recorded."""
        channels = {name: values.copy() for name, values in true.items() if name != "distance"}
        self._stamp(channels, dt, rng)
        percent = truck.reference_torque / 100.0
        of = {name: one for name, one in self.of.items() if name in channels}
        for name, one in of.items():
            unit = channels[name] if name == "fuel_rate" else _shaking(name, true["speed"], percent)
            channels[name] = _sensed(channels[name], one, unit, dt, rng)
        self._knock(channels, true["distance"], truck, dt, rng)
        self._lose(channels, dt, rng)
        for name, one in of.items():
            step = one.step * (percent if name == "engine_torque" else 1.0)
            channels[name] = quantise(channels[name], step)
        channels["speed"] = np.where(true["speed"] < 0.25, 0.0, np.maximum(channels["speed"], 0.0))
        channels["fuel_rate"] = np.maximum(channels["fuel_rate"], 0.0)
        step = self.of["engine_torque"].step * percent / truck.command_scale
        channels["engine_command"] = quantise(channels["engine_command"], step)
        pedal = 1.0 / 2048.0 if truck.by_deceleration else self.pedal_step
        channels["brake_command"] = quantise(channels["brake_command"], pedal)
        return channels

    def _stamp(self, channels: Channels, dt: float, rng: np.random.Generator) -> None:
        """Add jitter to message times, and delay responses."""
        clock = np.arange(len(channels["speed"])) * dt
        jitter = self.jitter_s * ou_series(rng, (1, len(clock)), dt, 0.2)[0]
        for name in TIMED:
            behind_s = self.late_s * rng.uniform(0.3, 1.0) * ("command" not in name)
            channels[name] = np.interp(clock + jitter - behind_s, clock, channels[name])

    def _knock(
        self, channels: Channels, distance: Array, truck: SimpleNamespace, dt: float, rng: np.random.Generator
    ) -> None:
        """Add the runout of a tone ring, once per wheel turn, and spikes of a loose bracket."""
        turns = distance / truck.wheel_radius + rng.uniform(0.0, 2.0 * np.pi)
        channels["speed"] = channels["speed"] * (1.0 + self.runout * np.sin(turns))
        knocks = rng.random(len(turns)) < self.spikes_per_min * dt / 60.0
        channels["acceleration"] = channels["acceleration"] + knocks * rng.normal(0.0, 0.5, len(turns))

    def _lose(self, channels: Channels, dt: float, rng: np.random.Generator) -> None:
        n = len(channels["speed"])
        burst = np.zeros(n, bool)
        for first in rng.integers(1, n, int(rng.poisson(self.bursts_per_min * n * dt / 60.0))):
            burst[first : first + int(rng.integers(1, 8))] = True
        for name in SLOW:
            channels[name] = _held(channels[name], burst | (rng.random(n) < self.lost))


def _sensed(values: Array, one: Sensor, unit: Array, dt: float, rng: np.random.Generator) -> Array:
    n = len(values)
    white = rng.standard_normal(n)
    noise = ou_series(rng, (1, n), dt, one.colour_s)[0] if one.colour_s else white
    values = lagged(values, one.lag_s, dt) if one.lag_s else values
    values = values + one.noise * noise * unit + one.bias
    if one.walk:
        values = values + np.cumsum(rng.standard_normal(n)) * one.walk * np.sqrt(dt / 60.0)
    comes = (np.arange(n) + rng.integers(one.every)) % one.every == 0
    return _held(values, ~comes) if one.every > 1 else values


def _held(values: Array, missing: NDArray[np.bool_]) -> Array:
    """The values with missing ones replaced by the last received one."""
    there = ~missing
    there[0] = True
    return np.asarray(values[np.maximum.accumulate(np.where(there, np.arange(len(values)), 0))])


def quantise(values: Array, step: float) -> Array:
    """Values rounded to whole steps; unchanged if step is 0."""
    return np.asarray(np.rint(values / step) * step) if step else values


def _shaking(name: str, speed: Array, percent: float) -> Array:
    """Noise factor of a channel, (n,), which increases with speed because the truck vibrates more."""
    if name in ("acceleration", "specific_force"):
        return 0.5 + 0.5 * np.clip(speed / 18.0, 0.0, 1.4)
    return np.full(len(speed), percent if name == "engine_torque" else 1.0)
