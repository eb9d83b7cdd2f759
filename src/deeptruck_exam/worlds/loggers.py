"""What a real truck records: filters, noise, slow messages, a clock that jitters, messages that are lost."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import SimpleNamespace

import numpy as np
from numpy.typing import NDArray

from deeptruck_exam.effects.law import Array, Channels
from deeptruck_exam.effects.series import behind, ou_series

KMH, RPM, LPH = 1.0 / 3.6, np.pi / 30.0, 1.0 / 3.6  # m/s, rad/s, cm3/s
Range = tuple[float, float]
TIMED = ("speed", "acceleration", "engine_command", "brake_command", "fuel_rate")
SLOW = ("acceleration", "fuel_rate", "engine_speed", "engine_torque", "grade")


@dataclass(frozen=True)
class Sensor:
    """One channel's, in its unit: fuel's noise is a share, torque's and its step are percent of the
    reference torque. `colour_s` of the noise (0: white); `walk` of the bias in a minute; `every`: samples
    from one message to the next; `step`: resolution (0: none)."""

    lag_s: float = 0.0
    noise: float = 0.0
    colour_s: float = 0.0
    bias: float = 0.0
    walk: float = 0.0
    every: int = 1
    step: float = 0.0


@dataclass(frozen=True)
class Sense:
    """What a world's sensors of one channel are drawn from; `bias` is a standard deviation."""

    noise: Range = (0.0, 0.0)
    colour_s: float = 0.0
    step: tuple[float, ...] = (0.0,)
    lag_s: Range = (0.0, 0.0)
    bias: float = 0.0
    walk: Range = (0.0, 0.0)
    every: tuple[int, ...] = (1,)

    def draw(self, rng: np.random.Generator) -> Sensor:
        return Sensor(
            rng.uniform(*self.lag_s),
            rng.uniform(*self.noise),
            self.colour_s,
            rng.normal(0.0, self.bias),
            rng.uniform(*self.walk),
            int(rng.choice(self.every)),
            float(rng.choice(self.step)),
        )


@dataclass(frozen=True)
class Sensors:
    """One truck's."""

    of: Mapping[str, Sensor]
    jitter_s: float
    late_s: float
    lost: float
    gaps: float
    spikes: float
    runout: float
    pedal_step: float


@dataclass(frozen=True)
class Logger:
    """A world's. Resolutions after SAE J1939-71: SPN 84 speed, SPN 190 engine speed, SPN 513 and 4154
    torque, SPN 183 fuel, SPN 521 brake pedal, SPN 580 altitude. `jitter_s` of the clock, with the time
    constant `jitter_tau_s`; `late_s`: latency of a message at most; `lost`: share of messages, `gaps`: bursts
    of lost ones in a minute, held or, if `joined`, joined by a line; `spikes` in a minute of a bracket that
    knocks; `runout` of a tone ring, once a turn of the wheel."""

    senses: Mapping[str, Sense] = field(default_factory=dict)
    jitter_s: Range = (0.0, 0.0)
    jitter_tau_s: float = 0.01
    late_s: Range = (0.0, 0.0)
    lost: Range = (0.0, 0.0)
    gaps: Range = (0.0, 0.0)
    spikes: Range = (0.0, 0.0)
    runout: Range = (0.0, 0.0)
    joined: bool = False
    pedal_steps: tuple[float, ...] = (0.4,)

    def draw(self, rng: np.random.Generator) -> Sensors:
        senses = {**USUAL, **self.senses}
        return Sensors(
            {name: sense.draw(rng) for name, sense in senses.items()},
            jitter_s=rng.uniform(*self.jitter_s),
            late_s=rng.uniform(*self.late_s),
            lost=rng.uniform(*self.lost),
            gaps=rng.uniform(*self.gaps),
            spikes=rng.uniform(*self.spikes),
            runout=rng.uniform(*self.runout),
            pedal_step=float(rng.choice(self.pedal_steps)),
        )

    def record(
        self,
        true: Channels,
        sensors: Sensors | None,
        truck: SimpleNamespace,
        dt: float,
        rng: np.random.Generator,
    ) -> Channels:
        """One recording's channels (n,) as measured; without sensors as they were. `distance` is never
        recorded."""
        channels = {name: values.copy() for name, values in true.items() if name != "distance"}
        if sensors is None:
            return channels
        self._stamp(channels, sensors, dt, rng)
        percent = truck.reference_torque / 100.0
        for name, one in sensors.of.items():
            unit = channels[name] if name == "fuel_rate" else _shaking(name, true["speed"], percent)
            channels[name] = self._sensed(channels[name], one, unit, dt, rng)
        self._knock(channels, true["distance"], sensors, truck, dt, rng)
        self._lose(channels, sensors, dt, rng)
        for name, one in sensors.of.items():
            channels[name] = quantise(
                channels[name], one.step * (percent if name == "engine_torque" else 1.0)
            )
        channels["speed"] = np.where(true["speed"] < 0.25, 0.0, np.maximum(channels["speed"], 0.0))
        channels["fuel_rate"] = np.maximum(channels["fuel_rate"], 0.0)
        step = sensors.of["engine_torque"].step * percent / truck.command_scale
        channels["engine_command"] = quantise(channels["engine_command"], step)
        pedal = 1.0 / 2048.0 if truck.by_deceleration else sensors.pedal_step
        channels["brake_command"] = quantise(channels["brake_command"], pedal)
        return channels

    def _stamp(self, channels: Channels, one: Sensors, dt: float, rng: np.random.Generator) -> None:
        clock = np.arange(len(channels["speed"])) * dt
        late = one.jitter_s * ou_series(rng, (1, len(clock)), dt, self.jitter_tau_s)[0]
        for name in TIMED:
            behind_s = one.late_s * rng.uniform(0.3, 1.0) * ("command" not in name)
            channels[name] = np.interp(clock + late - behind_s, clock, channels[name])

    def _sensed(self, values: Array, one: Sensor, unit: Array, dt: float, rng: np.random.Generator) -> Array:
        n = len(values)
        white = rng.standard_normal(n)
        noise = ou_series(rng, (1, n), dt, one.colour_s)[0] if one.colour_s else white
        values = behind(values, one.lag_s, dt) if one.lag_s else values
        values = values + one.noise * noise * unit + one.bias
        if one.walk:
            values = values + np.cumsum(rng.standard_normal(n)) * one.walk * np.sqrt(dt / 60.0)
        if one.every == 1:
            return values
        comes = (np.arange(n) + rng.integers(one.every)) % one.every == 0
        return self._filled(values, ~comes)

    def _filled(self, values: Array, missing: NDArray[np.bool_]) -> Array:
        """Values of messages that have come, in place of those that are missing."""
        missing = missing.copy()
        missing[[0, -1]] = [False, missing[-1] and not self.joined]
        at = np.arange(len(values))
        if self.joined:
            return np.interp(at, at[~missing], values[~missing])
        return np.asarray(values[np.maximum.accumulate(np.where(missing, 0, at))])

    def _knock(
        self,
        channels: Channels,
        distance: Array,
        one: Sensors,
        truck: SimpleNamespace,
        dt: float,
        rng: np.random.Generator,
    ) -> None:
        turns = distance / truck.wheel_radius + rng.uniform(0.0, 2.0 * np.pi)
        channels["speed"] = channels["speed"] * (1.0 + one.runout * np.sin(turns))
        knocks = rng.random(len(turns)) < one.spikes * dt / 60.0
        channels["acceleration"] = channels["acceleration"] + knocks * rng.normal(0.0, 0.5, len(turns))

    def _lose(self, channels: Channels, one: Sensors, dt: float, rng: np.random.Generator) -> None:
        n = len(channels["speed"])
        burst = np.zeros(n, bool)
        for first in rng.integers(1, n, int(rng.poisson(one.gaps * n * dt / 60.0))):
            burst[first : first + int(rng.integers(1, 8))] = True
        for name in SLOW:
            channels[name] = self._filled(channels[name], burst | (rng.random(n) < one.lost))


def quantise(values: Array, step: float) -> Array:
    """Whole steps; as it is where step is 0."""
    return np.asarray(np.rint(values / step) * step) if step else values


def _shaking(name: str, speed: Array, percent: float) -> Array:
    """What a channel's noise is multiplied by, (n,): a truck shakes the more the faster it is driven."""
    if name == "acceleration":
        return 0.5 + 0.5 * np.clip(speed / 18.0, 0.0, 1.4)
    return np.full(len(speed), percent if name == "engine_torque" else 1.0)


USUAL = {
    "speed": Sense((0.008, 0.03), 0.0, (KMH / 256.0,), lag_s=(0.03, 0.12)),
    "acceleration": Sense((0.03, 0.08), 0.0, (0.01,), bias=0.004),
    "grade": Sense((0.0006, 0.0018), 1.5, (0.0005,), bias=0.0004),
    "elevation": Sense((0.25, 0.65), 10.0, (0.125,)),
    "fuel_rate": Sense((0.006, 0.016), 0.0, (0.05 * LPH,)),
    "engine_speed": Sense((0.2, 0.2), 0.0, (0.125 * RPM,)),
    "engine_torque": Sense((0.3, 0.8), 0.0, (1.0,)),
}
