"""Roads: grade over position, and what a controller may know of the road ahead."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from deeptruck_core.arrays import Array
from deeptruck_core.errors import InputError

AHEAD_M = 25.0  # m between the grades of an observation's `grade_ahead`
AHEAD = 81  # of them: from here to 2 km ahead


@dataclass(frozen=True)
class Road:
    """Grades (rise over run) of a batch of roads, (batch, n): one every `spacing_m` metres from the start.

    Linear between them, constant beyond the ends. Raises InputError for another shape or values that are not
    finite.
    """

    grade: Array
    spacing_m: float = AHEAD_M

    def __post_init__(self) -> None:
        if self.grade.ndim != 2 or self.grade.shape[1] < 2 or not np.isfinite(self.grade).all():
            raise InputError("the grades of a road must be finite numbers (batch, 2 or more)")
        if not self.spacing_m > 0:
            raise InputError(f"the grades of a road are {self.spacing_m:g} m apart; it must be above 0")

    def at(self, position: Array) -> Array:
        """Grade (batch, k) at positions (batch, k), m from the start."""
        last = self.grade.shape[1] - 1
        place = np.clip(position / self.spacing_m, 0.0, last)
        k = np.minimum(place.astype(int), last - 1)
        before, after = (np.take_along_axis(self.grade, i, axis=1) for i in (k, k + 1))
        return np.asarray(before + (place - k) * (after - before))

    def ahead(self, position: Array, count: int = AHEAD) -> Array:
        """Grades (batch, count) every AHEAD_M metres, beginning at positions (batch,)."""
        return self.at(position[:, None] + AHEAD_M * np.arange(count))
