"""Random roads: grade against position, and the road and direction of each recording."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from deeptruck_core.arrays import Array

STEP_M = 10.0
CELLS = 6000  # 60 km


@dataclass(frozen=True)
class Roads:
    """`grade` (routes, cells) in the forward direction; per recording the route, the start and +1 or -1."""

    grade: Array
    route: NDArray[np.int64]
    start_m: Array
    direction: Array

    def grade_at(self, distance: Array) -> Array:
        """Slope in each recording after `distance` (batch,) m, uphill positive."""
        at = (self.start_m + self.direction * distance) / STEP_M % (self.grade.shape[1] - 1)
        low = at.astype(int)
        share = at - low
        value = (1.0 - share) * self.grade[self.route, low] + share * self.grade[self.route, low + 1]
        return np.asarray(self.direction * value)


def draw(rng: np.random.Generator, drives: Sequence[str], values: Mapping[str, Any], flat: bool) -> Roads:
    """One or two roads for each kind of drive; `values` is `roads` of worlds.yaml. The descent is driven in
    one direction only."""
    grades: list[Array] = []
    rows: dict[str, list[int]] = {}
    for kind in sorted(set(drives)):
        rows[kind] = []
        for _ in range(1 + (list(drives).count(kind) > 3)):
            rows[kind].append(len(grades))
            grades.append(slopes(rng, kind, values))
    route = np.array([rng.choice(rows[kind]) for kind in drives])
    back = (rng.random(len(drives)) < values["other_way"]) & np.array([kind != "descent" for kind in drives])
    start = rng.uniform(8500.0, 11500.0, len(drives)) + np.where(back, 5000.0, 0.0)
    grade = np.stack(grades) * (0.0 if flat else 1.0)
    return Roads(grade, route, start, np.where(back, -1.0, 1.0))


def slopes(rng: np.random.Generator, kind: str, values: Mapping[str, Any]) -> Array:
    """Grade (cells,) of one road: random heights with a power-law spectrum, limited as in road design."""
    wave = np.fft.rfftfreq(CELLS, STEP_M)  # 1/m
    power = 0.5 * rng.uniform(*values["exponent"])
    size = np.where(wave > 1.0 / rng.uniform(*values["longest_m"]), np.maximum(wave, 1e-9) ** -power, 0.0)
    size = size * np.exp(-((wave * rng.uniform(*values["smoothed_m"])) ** 2))
    height = size * np.exp(2j * np.pi * rng.random(len(wave)))
    slope = np.fft.irfft(2j * np.pi * wave * height, CELLS)
    amplitude, steepest = rng.uniform(*values["slope"][kind]), values["steepest"]
    limit = 2.2 * amplitude
    slope = limit * np.tanh(amplitude * slope / slope.std() / limit)
    if kind == "descent":
        return np.clip(slope - rng.uniform(*values["descent"]), -steepest, -0.012)
    return np.clip(slope, -steepest, steepest)
