"""The road: slope and surface, as profiles along the distance driven."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from deeptruck_model.constants import GRAVITY
from deeptruck_model.mismatch.expression import lift
from deeptruck_model.mismatch.mechanisms.base import (
    Column,
    Mechanism,
    Settings,
)
from deeptruck_model.mismatch.mechanisms.over_time import (
    MOST_KNOTS,
    profile_settings,
    share_out,
    slow_columns,
    slow_settings,
)
from deeptruck_model.mismatch.residual.evidence import Evidence

FINE_M, HILLY = 100.0, 0.02  # knots of a hilly road, and the sd of its slope
ROUGH = 0.1  # m/s^2: soft ground
SLOPE, SURFACE = lift(-GRAVITY), lift(-1.0)


def _grade_settings(e: Evidence) -> Iterator[Settings]:
    """Slopes of a plain come as slowly as wind does; those of hills are finer and larger than anything
    else."""
    yield from slow_settings(e, SLOPE, HILLY, "distance")
    yield from _fine(e, HILLY)


def _fine(e: Evidence, sd: float) -> Iterator[Settings]:
    lengths = [float(np.ptp(e["distance"][s.rows])) for s in e.stretches]
    for knot in (FINE_M, 2.5 * FINE_M):
        knots = share_out(lengths, knot, MOST_KNOTS)
        yield profile_settings(e, "distance", knots, knot) | {"sd": sd}


def _grade(s: Settings) -> list[Column]:
    return slow_columns(s, SLOPE, "grade", "ratio", sign=0, steady=False)


def _surface_settings(e: Evidence) -> Iterator[Settings]:
    yield from slow_settings(e, SURFACE, ROUGH, "distance")
    yield from _fine(e, ROUGH)


def _surface(s: Settings) -> list[Column]:
    return slow_columns(s, SURFACE, "force", "N", sign=1, per_mass=True)


MECHANISMS = (
    Mechanism(
        "road_grade",
        "F = -m g s(x)",
        "the road has a slope the simulator does not know",
        ("distance",),
        ("distance along the road",),
        "definition of grade",
        "drive the same stretch in both directions",
        _grade_settings,
        _grade,
        hidden=True,
        unlikely_with="grade",
    ),
    Mechanism(
        "road_surface",
        "F = -m c(x), c >= 0",
        "stretches of the road roll harder, whichever way they are driven",
        ("distance",),
        ("distance along the road",),
        "rolling resistance of road textures: MIRIAM project",
        "drive the same stretch in both directions",
        _surface_settings,
        _surface,
        hidden=True,
        prior=0.05,  # without a second pass it is any drag that comes and goes
    ),
)
