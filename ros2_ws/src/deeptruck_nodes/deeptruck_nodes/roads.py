"""Roads: grade and elevation over distance; `parse` reads a description from the command line."""

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


class Road(Protocol):
    """Anything that gives a grade (rise/run) and an elevation (m) at a distance from the start (m)."""

    def at(self, distance: float) -> tuple[float, float]: ...


@dataclass(frozen=True)
class Constant:
    grade: float = 0.0

    def __post_init__(self) -> None:
        require(abs(self.grade) <= 0.2, f"road: grade={self.grade} is outside -0.2..0.2")

    def at(self, distance: float) -> tuple[float, float]:
        return self.grade, self.grade * distance


@dataclass(frozen=True)
class Sine:
    """Sinusoidal hills with the given largest grade and a period of `length` metres."""

    grade: float = 0.03
    length: float = 2000.0

    def __post_init__(self) -> None:
        require(abs(self.grade) <= 0.2 and self.length >= 50, "road: need |grade| <= 0.2 and length >= 50 m")

    def at(self, distance: float) -> tuple[float, float]:
        phase = 2 * math.pi * distance / self.length
        return self.grade * math.sin(phase), self.grade * self.length / (2 * math.pi) * (1 - math.cos(phase))


@dataclass(frozen=True)
class Table:
    """A table with columns distance (m) and grade (rise/run), interpolated; beyond the ends the last grade is
    kept."""

    path: str

    def __post_init__(self) -> None:
        _, grades, _ = self._profile
        require(bool(np.all(np.abs(grades) <= 0.2)), f"{self.path}: a grade is outside -0.2..0.2")

    @functools.cached_property
    def _profile(self) -> tuple[Array, Array, Array]:
        from deeptruck_model.recordings.tables.table_file import read_curve

        return _with_elevation(*read_curve(Path(self.path), "distance", "grade"))

    def at(self, distance: float) -> tuple[float, float]:
        return _interpolate(self._profile, distance)


@dataclass(frozen=True)
class Random:
    """A smooth random grade of about the given size, redrawn every `length` metres, for 500 km."""

    grade: float = 0.02
    length: float = 500.0
    seed: int = 0

    def __post_init__(self) -> None:
        require(
            0 <= self.grade <= 0.07 and self.length >= 50, "road: need 0 <= grade <= 0.07 and length >= 50 m"
        )
        require(self.seed >= 0, "road: seed must not be negative")

    @functools.cached_property
    def _profile(self) -> tuple[Array, Array, Array]:
        distances: Array = np.arange(0.0, 500e3, self.length, dtype=np.float64)
        grades = np.random.default_rng(self.seed).normal(0.0, self.grade, len(distances))
        return _with_elevation(distances, np.clip(grades, -3 * self.grade, 3 * self.grade))

    def at(self, distance: float) -> tuple[float, float]:
        return _interpolate(self._profile, distance)


def _with_elevation(distances: Array, grades: Array) -> tuple[Array, Array, Array]:
    rises: Array = np.diff(distances) * (grades[1:] + grades[:-1]) / 2
    return distances, grades, np.concatenate(([0.0], np.cumsum(rises)))


def _interpolate(profile: tuple[Array, Array, Array], distance: float) -> tuple[float, float]:
    distances, grades, elevations = profile
    grade = float(np.interp(distance, distances, grades))
    k = max(int(np.searchsorted(distances, distance, side="right")) - 1, 0)
    return grade, float(elevations[k] + (grades[k] + grade) / 2 * (distance - distances[k]))


KINDS: dict[str, type] = {
    "flat": Constant,
    "constant": Constant,
    "sine": Sine,
    "random": Random,
    "table": Table,
}


def parse(text: str) -> Road:
    """The road described by a text such as 'sine:grade=0.02'. Raises InputError."""
    road: Road = choice.parse(text, KINDS, "road")
    return road
