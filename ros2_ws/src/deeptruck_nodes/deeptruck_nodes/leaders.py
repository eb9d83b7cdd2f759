"""Leaders: speeds over time that are scripted, random or recorded; `parse` reads a description."""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np

from deeptruck_core.arrays import Array
from deeptruck_nodes import choice
from deeptruck_nodes.choice import require


class Leader(Protocol):
    """Anything that gives a speed in m/s at t seconds after the start; t never decreases."""

    def speed_at(self, t: float) -> float: ...


@dataclass(frozen=True)
class Constant:
    """Constant `speed` (m/s)."""

    speed: float = 20.0

    def __post_init__(self) -> None:
        require(0 <= self.speed <= 50, f"leader: speed={self.speed} is outside 0..50 m/s")

    def speed_at(self, t: float) -> float:
        return self.speed


@dataclass(frozen=True)
class Sine:
    """speed + amplitude sin(2 pi t / period) in m/s, period in s: an acceleration amplitude of
    2 pi amplitude / period."""

    speed: float = 20.0
    amplitude: float = 1.2
    period: float = 15.0

    def __post_init__(self) -> None:
        require(self.period > 0, "leader: period must be positive")
        require(0 <= self.amplitude <= self.speed <= 50, "leader: need 0 <= amplitude <= speed <= 50 m/s")

    def speed_at(self, t: float) -> float:
        return self.speed + self.amplitude * math.sin(2 * math.pi * t / self.period)


@dataclass(frozen=True)
class Steps:
    """A new speed (m/s) every `every` s, approached at `acceleration` (m/s^2); the last speed is kept."""

    speeds: tuple[float, ...] = (20.0, 23.0, 18.0, 20.0)
    every: float = 30.0
    acceleration: float = 1.0

    def __post_init__(self) -> None:
        require(self.every > 0 and self.acceleration > 0, "leader: every and acceleration must be positive")
        require(all(0 <= v <= 50 for v in self.speeds), "leader: a speed is outside 0..50 m/s")

    def speed_at(self, t: float) -> float:
        speed, last = self.speeds[0], len(self.speeds) - 1
        for n, target in enumerate(self.speeds[1:], start=1):
            since = max(t - n * self.every, 0.0)
            most = self.acceleration * (since if n == last else min(since, self.every))
            speed += math.copysign(min(abs(target - speed), most), target - speed)
        return speed


@dataclass(frozen=True)
class Stop:
    """Drives at `speed` (m/s), brakes from `at` s on at `deceleration` (m/s^2), stands for `wait` s, then
    accelerates at 0.8 m/s^2."""

    speed: float = 20.0
    at: float = 30.0
    deceleration: float = 2.0
    wait: float = 10.0

    def __post_init__(self) -> None:
        require(0 < self.speed <= 50, f"leader: speed={self.speed} is outside 0..50 m/s")
        require(0 < self.deceleration <= 12, "leader: deceleration is outside 0..12 m/s^2")
        require(self.at >= 0 and self.wait >= 0, "leader: at and wait must not be negative")

    def speed_at(self, t: float) -> float:
        standing = self.at + self.speed / self.deceleration
        if t <= standing + self.wait:
            return max(0.0, self.speed - self.deceleration * max(t - self.at, 0.0))
        return min(self.speed, 0.8 * (t - standing - self.wait))


@dataclass(frozen=True)
class Random:
    """Picks a speed in low..high (m/s) every 5 to 25 s and approaches it at 0.2 to 1 times `acceleration`
    (m/s^2)."""

    low: float = 12.0
    high: float = 25.0
    acceleration: float = 1.0
    seed: int = 0

    def __post_init__(self) -> None:
        require(0 <= self.low <= self.high <= 50, "leader: need 0 <= low <= high <= 50 m/s")
        require(
            self.acceleration > 0 and self.seed >= 0,
            "leader: acceleration must be positive, seed not negative",
        )

    @functools.cached_property
    def _walk(self) -> tuple[Array, Array]:
        rng = np.random.default_rng(self.seed)
        times, speeds = [0.0], [rng.uniform(self.low, self.high)]
        while times[-1] < 8 * 3600:  # then it keeps its speed
            target = rng.uniform(self.low, self.high)
            reach = abs(target - speeds[-1]) / (self.acceleration * rng.uniform(0.2, 1.0))
            times += [times[-1] + reach + 1e-6, times[-1] + reach + rng.uniform(5.0, 25.0)]
            speeds += [target, target]
        return np.array(times), np.array(speeds)

    def speed_at(self, t: float) -> float:
        return float(np.interp(t, *self._walk))


@dataclass(frozen=True)
class Recorded:
    """A leader driven before: a table with a `time` column in s and a speed column in m/s, or a bag.

    A bag gives its first recording without interruption: the leader's speed if it was recorded, otherwise the
    truck's. After the end the last speed is kept.
    """

    path: str
    column: str = "speed"

    def __post_init__(self) -> None:
        times, speeds = self._samples
        require(len(times) > 1, f"{self.path}: a leader needs two speeds or more, not {len(times)}")
        require(bool(np.all(np.diff(times) > 0)), f"{self.path}: time does not grow")
        require(bool(np.all((speeds >= -1) & (speeds <= 60))), f"{self.path}: a speed is outside -1..60 m/s")

    @functools.cached_property
    def _samples(self) -> tuple[Array, Array]:
        path = Path(self.path)
        if not path.is_dir() and path.suffix not in (".mcap", ".db3", ".bag"):
            from deeptruck_model.recordings.tables.table_file import read_curve

            times, speeds = read_curve(path, "time", self.column)
            return times - times[0], speeds
        from deeptruck_model import recordings

        recording = recordings.read(path)[0]
        speed = recording.channels.get("leader_speed", recording.channels["speed"])
        good = np.isfinite(speed)
        return (recording.time - recording.start_s)[good], speed[good]

    def speed_at(self, t: float) -> float:
        return float(np.interp(t, *self._samples))


KINDS: dict[str, type] = {
    "constant": Constant,
    "sine": Sine,
    "steps": Steps,
    "stop": Stop,
    "random": Random,
    "recorded": Recorded,
}


def parse(text: str) -> Leader:
    """The leader described by a text such as 'sine:speed=18,amplitude=2'. Raises InputError."""
    require(not text.startswith("sumo:"), f"leader '{text}': SUMO is gone; use recorded:path=FILE")
    leader: Leader = choice.parse(text, KINDS, "leader")
    return leader
