"""Terms that change on the way: from a moment on, from drive to drive, or as they like between knots."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any, Literal

import numpy as np

from deeptruck_model.mismatch.expression import AtPlace, Expression, InRecording, Knot, Signal
from deeptruck_model.mismatch.mechanisms.base import (
    Column,
)
from deeptruck_model.mismatch.mechanisms.symbols import PLACE
from deeptruck_model.mismatch.mechanisms.variants import (
    NONE,
    Constants,
    FromMoment,
    PerRecording,
    Spline,
    Variant,
)
from deeptruck_model.mismatch.residual.evidence import Evidence

Along = Literal["elapsed", "distance"]
ELAPSED: Literal["elapsed"] = "elapsed"
DISTANCE: Literal["distance"] = "distance"


SLOW_KNOT_S = (20.0, 40.0)  # shortest and longest distance of the finer knots
COARSER = 3.0
SLOW_SIZES = (0.025, 0.1)  # m/s^2 sd of a force that is time-varying
MOST_KNOTS = 80
BIN_M = 10.0  # in which a road is counted
TWICE = 1.5  # times that a road was driven, below which nothing position-dependent is visible


def moments(e: Evidence, most: int = 32) -> Iterator[FromMoment]:
    """Moments from which something may be different: evenly spread, and every start of a recording."""
    rows = np.arange(len(e))
    spread = rows[:: max(1, len(e) // most)].tolist()
    points = sorted({s.start for s in e.stretches} | set(spread))
    points = [p for p in points if 0.04 * len(e) < p < 0.96 * len(e)]
    yield from from_each(points, e)


def from_each(points: Sequence[int], e: Evidence) -> Iterator[FromMoment]:
    """From each of these rows on."""
    record, elapsed = e.record, e["elapsed"]
    for p in points:
        yield FromMoment(int(record[p]), float(elapsed[p]), len(e.stretches), len(points))


def from_then_on(v: FromMoment) -> Expression:
    """One after the moment, zero before; in a simulation it is always one."""
    later: Expression = InRecording(v.first, from_s=v.after_s, elsewhere=1.0)
    for i in range(v.first + 1, v.count):
        later = later + InRecording(i)
    return later


def share_out(lengths: list[float], spacing: float, most: int) -> list[int]:
    """Knots for each recording at `spacing`, until `most` are used up; later recordings get none.

    A log of many hours would otherwise have knots too far apart to show anything anywhere.
    """
    out, left = [], most
    for length in lengths:
        count = int(length / spacing) + 2
        count = count if count <= left else (left if left == most else 0)
        out.append(count)
        left -= count
    return out


def durations(e: Evidence) -> list[float]:
    """Length of each recording in s."""
    return [(s.stop - s.start) * e.dt for s in e.stretches]


def splines(
    e: Evidence,
    carrier: Expression,
    largest: float,
    along: Along = ELAPSED,
    *,
    quick: bool = True,
    constants: Constants = NONE,
    levels: bool = False,
) -> Iterator[Spline]:
    """Knots in time or distance, afresh in every recording, for a force that varies in time on a carrier.

    Every name gets the same knots and the same sizes of force, up to the `largest` sd of its coefficient that
    is physically possible: between two of them only how the force varies with the carrier decides. What is
    not `quick` cannot change from one of the finer knots to the next.
    """
    moving = e.valid & (e["speed"] > 1.0)
    typical = float(np.sqrt(np.mean(np.square(carrier.rows(e)[moving])))) if moving.any() else 0.0
    if typical <= 0.0:
        return
    pace = float(np.mean(e["speed"][moving])) if along == DISTANCE else 1.0
    lengths = [float(np.ptp(e[along][s.rows])) for s in e.stretches]
    spare = max(MOST_KNOTS - 2 * len(lengths), 1)
    fine_s = float(np.clip(len(e) * e.dt / spare, *SLOW_KNOT_S))
    for knot_s in (fine_s, COARSER * fine_s) if quick else (COARSER * fine_s,):
        knots = share_out(lengths, knot_s * pace, MOST_KNOTS)
        slow = replace(profile(e, along, knots, knot_s * pace, 0.0), constants=constants, levels=levels)
        for sd in sorted({min(size / typical, largest) for size in SLOW_SIZES}):
            yield replace(slow, sd=sd)


def profile(e: Evidence, along: Along, knots: Sequence[int], spacing: float, sd: float) -> Spline:
    """A spline with so many knots in each recording; a simulation is left with the mean over those that are
    not held out."""
    fitted = sum(k for k, s in zip(knots, e.stretches, strict=True) if not s.held_out)
    mean = 1.0 / max(fitted or sum(knots), 1)
    return Spline(along, tuple(knots), tuple(s.name for s in e.stretches), spacing, mean, sd)


def of_all(e: Evidence, v: Spline) -> Iterator[Spline]:
    """The same with knots at places, which every drive has that comes by; wider apart where the road is long.
    None where hardly any of it is driven twice."""
    known = e.valid & (e["place"] >= 0.0)
    driven = float(np.sum(e["speed"][known])) * e.dt
    if driven < TWICE * BIN_M * len(np.unique((e["place"][known] / BIN_M).astype(int))):
        return
    last = float(np.max(e["place"][known], initial=0.0))
    spacing = max(v.spacing, last / (MOST_KNOTS - 2))
    knots = int(last / spacing) + 2
    yield replace(v, knots=(knots,), spacing=spacing, shared=True, mean=1.0 / knots)


def each_recording(e: Evidence, constants: Constants = NONE) -> PerRecording:
    """A coefficient for every recording; a simulation is left with the mean over those that are not held
    out."""
    fitted = sum(not s.held_out for s in e.stretches)
    return PerRecording(tuple(s.name for s in e.stretches), 1.0 / max(fitted, 1), constants)


def in_each(v: PerRecording) -> Iterator[tuple[str, Expression]]:
    """The name of every recording, and what is one in it alone."""
    for i, name in enumerate(v.names):
        yield name, InRecording(i, elsewhere=v.mean)


def spline_columns(
    v: Variant, carrier: Expression, name: str, unit: str, *, sign: int, steady: bool = True, **options: Any
) -> list[Column]:
    """A coefficient for every knot of a spline, beside one that holds always where `steady`.

    A simulation of another drive is left with the mean over the knots. `options` go on to Column. Raises
    TypeError for what is no spline.
    """
    if not isinstance(v, Spline):
        raise TypeError(f"{v!r} is no spline")
    along = (Signal(v.along),)
    alone = not v.knots

    def knot(i: int, at: float) -> Expression:
        if v.shared:
            return AtPlace((PLACE,), at, v.spacing, v.mean)
        return Knot(along, i, at, v.spacing, v.mean)

    always = [Column(carrier, 2.0 * v.sd, name, unit, sign=sign, **options)] if steady or alone else []
    unit_of_knots = "s" if v.along == ELAPSED else "m"
    where = [""] if v.shared else [f"{recording}, " for recording in v.names]
    return always + [
        Column(
            carrier * knot(i, k * v.spacing),
            v.sd,
            f"{name}[{where[i]}{k * v.spacing:.0f} {unit_of_knots}]",
            unit,
            sign=sign,
            **options,
        )
        for i, count in enumerate(v.knots)
        for k in range(count)
    ]
