"""What recordings are enough for: conditions that a truck's model needs, with the time driven in each."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from deeptruck_model.recordings.coverage_grid import ACCELERATION_EDGES, GRADE_EDGES, SPEED_EDGES

ENOUGH_S = 1800.0  # of driving to train on; 15 min leave some three times the error of 60 (results/minutes)
ENOUGH_IN_CONDITION_S = 60.0  # chosen: some ten episodes of braking or launching


@dataclass(frozen=True)
class Condition:
    """A part of the grid of coverage, and the time that was driven in it, s."""

    name: str
    driven_s: float

    @property
    def enough(self) -> bool:
        """Whether a model can learn it."""
        return self.driven_s >= ENOUGH_IN_CONDITION_S


def conditions(seconds: NDArray[np.float64]) -> tuple[Condition, ...]:
    """Of the time `seconds` (speed, acceleration, grade) in the cells of coverage."""
    speed, acceleration = SPEED_EDGES[:-1], ACCELERATION_EDGES[:-1]
    by_speed, by_acceleration = seconds.sum(axis=(1, 2)), seconds.sum(axis=(0, 2))
    by_grade, grade = seconds[:, :, :-1].sum(axis=(0, 1)), GRADE_EDGES[:-1].round(6)
    parts = (
        ("below 4 m/s", by_speed[speed < 4.0]),
        ("4 to 16 m/s", by_speed[(speed >= 4.0) & (speed < 16.0)]),
        ("above 16 m/s", by_speed[speed >= 16.0]),
        ("accelerating above 0.5 m/s²", by_acceleration[acceleration >= 0.5]),
        ("slowing by 0.5 to 2 m/s²", by_acceleration[(acceleration >= -2.0) & (acceleration < -0.5)]),
        ("slowing by more than 2 m/s²", by_acceleration[acceleration < -2.0]),
        ("uphill above 2 %", by_grade[grade >= 0.02]),
        ("downhill above 2 %", by_grade[grade < -0.02]),
    )
    return tuple(Condition(name, float(part.sum())) for name, part in parts)


def judgement(seconds: NDArray[np.float64], duration_s: float, commanded: bool) -> str:
    """One sentence: whether it is enough to train on, and the conditions in which it is not.

    `commanded` says whether a valid engine command was recorded.
    """
    if not commanded:
        return "Enough to train: no, as no engine command is valid."
    if duration_s < ENOUGH_S:
        return (
            f"Enough to train: no, {_long(duration_s)} were driven, and {ENOUGH_S / 60:.0f} min are needed."
        )
    lacking = [f"{c.name}: no ({_long(c.driven_s)})" for c in conditions(seconds) if not c.enough]
    return "; ".join([f"Enough to train: yes ({_long(duration_s)})", *lacking]) + "."


def _long(seconds: float) -> str:
    if seconds < 120.0:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 7200.0 else f"{seconds / 3600:.1f} h"


def rows(seconds: NDArray[np.float64]) -> tuple[tuple[str, ...], ...]:
    """Condition, time driven, and whether that is enough, as text."""
    return tuple((c.name, _long(c.driven_s), "yes" if c.enough else "no") for c in conditions(seconds))
