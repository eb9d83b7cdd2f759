"""Shapes that change on the way: from a moment on, from drive to drive, or as they like between knots."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from deeptruck_model.mismatch.expression import Expression, InRecording, Knot, Signal, lift
from deeptruck_model.mismatch.mechanisms.base import (
    Column,
    Mechanism,
    Settings,
)
from deeptruck_model.mismatch.residual.evidence import Evidence

ANY, LARGEST = lift(1.0), 0.5  # m/s^2


def _settings(e: Evidence) -> Iterator[Settings]:
    for along in ("elapsed", "distance"):
        yield from slow_settings(e, ANY, LARGEST, along)


def _columns(s: Settings) -> list[Column]:
    return slow_columns(s, ANY, "force", "N", sign=0, per_mass=True)


UNNAMED = Mechanism(
    "unknown",
    "F = f(t)",
    "a force comes and goes as none of the known ones does",
    (),
    ("time", "distance along the road"),
    "",
    "drive the same stretch twice in either direction, at two speeds",
    _settings,
    _columns,
)


MANY_SHAPES = 20  # something that comes and goes as it likes can stand in for much else; it pays for that
SLOW_KNOT_S = (20.0, 40.0)  # shortest and longest distance of the finer knots
COARSER = 3.0
SLOW_SIZES = (0.025, 0.1)  # m/s^2 sd of a force that comes and goes
MOST_KNOTS = 80


def step_settings(e: Evidence, most: int = 32) -> Iterator[Settings]:
    """Moments from which something may be different: evenly spread, and every start of a recording."""
    rows = np.arange(len(e))
    spread = rows[:: max(1, len(e) // most)].tolist()
    points = sorted({s.start for s in e.stretches} | set(spread))
    points = [p for p in points if 0.04 * len(e) < p < 0.96 * len(e)]
    record, elapsed = e.record, e["elapsed"]
    for p in points:
        yield {
            "first": int(record[p]),
            "after_s": float(elapsed[p]),
            "count": len(e.stretches),
            "trials": len(points),
        }


def from_then_on(s: Settings) -> Expression:
    """One after the moment of `step_settings`, zero before; in a simulation it is always one."""
    later: Expression = InRecording(s["first"], from_s=s["after_s"], elsewhere=1.0)
    for i in range(s["first"] + 1, s["count"]):
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


def slow_settings(
    e: Evidence, carrier: Expression, largest: float, along: str = "elapsed", *, quick: bool = True
) -> Iterator[Settings]:
    """Knots in time or distance, afresh in every recording, for a force that comes and goes on a carrier.

    Every name gets the same knots and the same sizes of force, up to the `largest` sd of its coefficient that
    is physically possible: between two of them only how the force varies with the carrier decides. What lies
    along the road may be the same for all recordings, where they start at one place. What is not `quick`
    cannot change from one of the finer knots to the next.
    """
    moving = e.valid & (e["speed"] > 1.0)
    typical = float(np.sqrt(np.mean(np.square(carrier.rows(e)[moving])))) if moving.any() else 0.0
    if typical <= 0.0:
        return
    pace = float(np.mean(e["speed"][moving])) if along == "distance" else 1.0
    lengths = [float(np.ptp(e[along][s.rows])) for s in e.stretches]
    spare = max(MOST_KNOTS - 2 * len(lengths), 1)
    fine_s = float(np.clip(len(e) * e.dt / spare, *SLOW_KNOT_S))
    for knot_s in (fine_s, COARSER * fine_s) if quick else (COARSER * fine_s,):
        knots = share_out(lengths, knot_s * pace, MOST_KNOTS)
        slow = profile_settings(e, along, knots, knot_s * pace)
        for sd in sorted({min(size / typical, largest) for size in SLOW_SIZES}):
            yield slow | {"sd": sd}
            if along == "distance" and len(lengths) > 1:
                longest = min(int(max(lengths) / (knot_s * pace)) + 2, MOST_KNOTS)
                yield slow | {"sd": sd, "knots": [longest], "shared": True, "mean": 1.0 / longest}


def profile_settings(e: Evidence, along: str, knots: list[int], knot: float) -> Settings:
    """Knots as slow_columns takes them; a simulation is left with the mean over those that are not held
    out."""
    fitted = sum(k for k, s in zip(knots, e.stretches, strict=True) if not s.held_out)
    return {
        "along": along,
        "knots": knots,
        "names": [s.name for s in e.stretches],
        "knot": knot,
        "trials": MANY_SHAPES,
        "mean": 1.0 / max(fitted or sum(knots), 1),
    }


def each_recording(e: Evidence) -> Settings:
    """A coefficient for every recording; a simulation is left with the mean over those that are not held
    out."""
    fitted = sum(not s.held_out for s in e.stretches)
    return {"each": [s.name for s in e.stretches], "mean": 1.0 / max(fitted, 1)}


def in_each(s: Settings) -> Iterator[tuple[str, Expression]]:
    """The name of every recording of `each_recording`, and what is one in it alone."""
    for i, name in enumerate(s["each"]):
        yield name, InRecording(i, elsewhere=s["mean"])


def slow_columns(
    s: Settings, carrier: Expression, name: str, unit: str, *, sign: int, steady: bool = True, **told: Any
) -> list[Column]:
    """A coefficient for every knot of `slow_settings`, beside one that holds always where `steady`.

    A simulation of another drive is left with the mean over the knots. `told` goes on to Column.
    """
    along = (Signal(s["along"]),)
    alone = not s["knots"]
    always = [Column(carrier, 2.0 * s["sd"], name, unit, sign=sign, **told)] if steady or alone else []
    unit_of_knots = "s" if s["along"] == "elapsed" else "m"
    where = [""] if "shared" in s else [f"{recording}, " for recording in s["names"]]
    return always + [
        Column(
            carrier * Knot(along, -1 if "shared" in s else i, k * s["knot"], s["knot"], s["mean"]),
            s["sd"],
            f"{name}[{where[i]}{k * s['knot']:.0f} {unit_of_knots}]",
            unit,
            sign=sign,
            **told,
        )
        for i, count in enumerate(s["knots"])
        for k in range(count)
    ]
