"""Roads: grade against position, and which recording drives which road in which direction."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from deeptruck_exam.hidden import Array

STEP_M = 10.0
LENGTH_M = 60000.0
AMPLITUDE = {"highway": 0.013, "suburban": 0.010, "hills": 0.032, "descent": 0.0}


@dataclass(frozen=True)
class Roads:
    """`grade` (routes, cells) for driving forwards; per recording the route, the start and +1 or -1."""

    grade: Array
    route: NDArray[np.int64]
    start_m: Array
    direction: Array
    grade_offset: Array  # per recording: a descent is a road of its own, steadily down

    def grade_at(self, distance: Array) -> Array:
        """Slope met by each recording after `distance` (batch,) m, uphill positive."""
        at = (self.start_m + self.direction * distance) / STEP_M % (self.grade.shape[1] - 1)
        low = at.astype(int)
        share = at - low
        rows = self.grade[self.route]
        here = np.arange(len(low))
        value = (1.0 - share) * rows[here, low] + share * rows[here, low + 1]
        return np.asarray(self.direction * value + self.grade_offset)


def draw_profile(rng: np.random.Generator, amplitude: float) -> Array:
    """Grade of a road: sinusoids of 400 m to 8 km with random phase, slopes of standard deviation
    `amplitude`."""
    position = np.arange(0.0, LENGTH_M, STEP_M)
    lengths = np.exp(rng.uniform(np.log(400.0), np.log(8000.0), 14))
    size = rng.rayleigh(1.0, 14) * lengths**0.3
    waves = np.sin(2.0 * np.pi * position / lengths[:, None] + rng.uniform(0.0, 2.0 * np.pi, (14, 1)))
    profile = size @ waves
    return np.clip(amplitude * profile / profile.std(), -0.075, 0.075)


def draw_roads(
    rng: np.random.Generator,
    scenarios: list[str],
    flat: bool,
    profile: Callable[[np.random.Generator, float], Array] = draw_profile,
) -> Roads:
    """One road for each scenario kind but two for the commonest; about a third of the drives go the other
    way. `profile` draws a road's grade."""
    kinds = sorted(set(scenarios))
    grade = np.stack([profile(rng, 0.0 if flat else AMPLITUDE[kind] + 1e-9) for kind in kinds])
    route = np.array([kinds.index(s) for s in scenarios])
    start = rng.uniform(8000.0, 12000.0, len(scenarios))
    direction = np.where(rng.random(len(scenarios)) < 0.35, -1.0, 1.0)
    start = np.where(direction < 0, start + 4500.0, start)
    offset = np.array([-rng.uniform(0.045, 0.065) if s == "descent" and not flat else 0.0 for s in scenarios])
    return Roads(grade * (0.0 if flat else 1.0), route, start, direction, offset)
