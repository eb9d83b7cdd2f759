"""The road: slope and surface, as profiles along the distance driven."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import numpy as np

from deeptruck_model.constants import GRAVITY
from deeptruck_model.mismatch.expression import Expression, lift
from deeptruck_model.mismatch.mechanisms.base import (
    Column,
    Mechanism,
)
from deeptruck_model.mismatch.mechanisms.over_time import (
    MOST_KNOTS,
    each_recording,
    in_each,
    of_all,
    profile,
    share_out,
    spline_columns,
    splines,
)
from deeptruck_model.mismatch.mechanisms.variants import PerRecording, Simple, Spline, Variant
from deeptruck_model.mismatch.residual.evidence import Evidence

FINE_M, HILLY = 100.0, 0.02  # knots of a hilly road, and the sd of its slope
ROUGH = 0.1  # m/s^2: soft ground
WET = 0.02  # m/s^2: a third of what tyres take, from one whole drive to another
SLOPE, SURFACE = lift(-GRAVITY), lift(-1.0)


def _grades(e: Evidence) -> Iterator[Variant]:
    """Slopes of a plain come as slowly as wind does; those of hills are finer and larger than anything
    else. Where none was recorded it may be one and the same slope; else that is the sensor's zero."""
    if not e.has("grade"):
        yield from (s.steady() for s in itertools.islice(_fine(e, HILLY / 2), 1))
    yield from _along(e, SLOPE, HILLY)


def _along(e: Evidence, carrier: Expression, largest: float) -> Iterator[Spline]:
    """Profiles afresh in every recording, and those that come again wherever a drive comes by: what belongs
    to a place is the road's."""
    for own in (*splines(e, carrier, largest, "distance"), *_fine(e, largest)):
        yield own
        yield from of_all(e, own)


def _fine(e: Evidence, sd: float) -> Iterator[Spline]:
    lengths = [float(np.ptp(e["distance"][s.rows])) for s in e.stretches]
    for knot in (FINE_M, 2.5 * FINE_M):
        yield profile(e, "distance", share_out(lengths, knot, MOST_KNOTS), knot, sd)


def _grade(v: Simple) -> list[Column]:
    return spline_columns(v, SLOPE, "grade", "ratio", sign=0, steady=False)


def _surfaces(e: Evidence) -> Iterator[Simple]:
    """Stretches of it, or another road, or rain, on whole drives."""
    if 2 < len(e.stretches) <= MOST_KNOTS:
        yield each_recording(e)
    yield from _along(e, SURFACE, ROUGH)


def _surface(v: Simple) -> list[Column]:
    if isinstance(v, PerRecording):
        return [
            Column(SURFACE * here, WET, f"force[{name}]", "N", per_mass=True, sign=0)
            for name, here in in_each(v)
        ]
    return spline_columns(v, SURFACE, "force", "N", sign=1, per_mass=True)


MECHANISMS = (
    Mechanism(
        "road_grade",
        "F = -m g s(x)",
        "the road has a slope the simulator does not know",
        ("distance",),
        ("distance along the road",),
        "definition of grade",
        "drive the same stretch in both directions",
        _grades,
        _grade,
        unlikely_with="grade",
    ),
    Mechanism(
        "road_surface",
        "F = -m c(x), c >= 0, or one c in each recording",
        "the road rolls harder, in stretches or on whole drives",
        ("distance",),
        ("distance along the road", "recording"),
        "rolling resistance of road textures: MIRIAM project",
        "drive the same stretch in both directions",
        _surfaces,
        _surface,
        prior=0.05,  # what does not come again is any drag that is time-varying
    ),
)
