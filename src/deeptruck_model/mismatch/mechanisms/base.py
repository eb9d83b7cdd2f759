"""What a mechanism is: a piece of physics by the way it acts, not by one formula.

A mechanism says which signals drive it, in which direction it can only act, and how large it can be. It
offers a few shapes: settings (time constants, thresholds, knots: whatever enters nonlinearly) from which
`build` makes columns in m/s^2 per unit coefficient, each with a prior and perhaps a sign. Settings are chosen
by evidence, coefficients are fitted.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from deeptruck_model.mismatch.evidence import Evidence
from deeptruck_model.mismatch.expression import During, Expression, InRecording, Knot, Signal, maximum
from deeptruck_model.mismatch.noise import Prior

Array = NDArray[np.float64]
Settings = dict[str, Any]  # plain JSON values

SPEED, ENGINE, BRAKE = Signal("speed"), Signal("engine"), Signal("brake")
DRAG, ROLLING = Signal("drag"), Signal("rolling")
ELAPSED, DISTANCE, SIMULATED = Signal("elapsed"), Signal("distance"), Signal("simulated")
ENGINE_COMMAND, BRAKE_COMMAND = Signal("engine_command"), Signal("brake_command")
ENGINE_SPEED, RATIO, GEAR = Signal("engine_speed"), Signal("ratio"), Signal("gear")
MANY_SHAPES = 20  # something that comes and goes as it likes can stand in for much else; it pays for that
SLOW_KNOT_S = (20.0, 40.0)  # shortest and longest distance of the finer knots
COARSER = 3.0
SLOW_SIZES = (0.025, 0.1)  # m/s^2 sd of a force that comes and goes
MOST_KNOTS = 80
PULL = maximum(ENGINE, 0.0)


@dataclass(frozen=True)
class Column:
    """One coefficient: what it multiplies, its prior, and how people are told it (unit, factor into it)."""

    expression: Expression
    sd: float
    name: str
    unit: str = "1"
    factor: float = 1.0
    per_mass: bool = False  # the coefficient times the mass (kg) is in `unit`
    sign: int = 1  # +1: never negative; 0: free
    mean: float = 0.0


@dataclass(frozen=True)
class Mechanism:
    """A named piece of physics.

    `needs` are the signals without which it cannot be tested; `depends_on` what it varies with, for people;
    `hidden` says that its driver is not among a simulator's inputs, so that a learned simulator cannot have
    absorbed it; `prior` is its prior probability relative to the others.
    """

    effect: str
    equation: str
    says: str
    needs: tuple[str, ...]
    depends_on: tuple[str, ...]
    source: str
    told_by: str
    settings: Callable[[Evidence], Iterator[Settings]] = field(repr=False)
    build: Callable[[Settings], list[Column]] = field(repr=False)
    kind: str = "missing_physics"
    hidden: bool = False
    prior: float = 1.0
    unlikely_with: str = ""  # a recorded signal that makes this a fifth as likely: it would show there

    def chance(self, e: Evidence) -> float:
        """Prior probability relative to the other mechanisms, given which signals were recorded."""
        return self.prior * (0.2 if self.unlikely_with and e.has(self.unlikely_with) else 1.0)


@dataclass(frozen=True)
class Shape:
    """A mechanism with settings, evaluated: columns (n, k) and their prior."""

    mechanism: Mechanism
    settings: Settings
    parts: tuple[Column, ...]
    columns: Array
    prior: Prior
    trials: float  # how many alternatives these settings were picked from; paid for in evidence


def build(mechanism: Mechanism, settings: Settings) -> list[Column]:
    """The columns of a shape; several settings under "parts" give columns side by side."""
    if "parts" in settings:
        columns = [c for part in settings["parts"] for c in build(mechanism, part)]
    else:
        columns = mechanism.build(settings)
    if "when" in settings:
        columns = [replace(c, expression=During((c.expression,), settings["when"])) for c in columns]
    if "gate" not in settings:
        return columns
    signal, side, at = settings["gate"]
    above = Signal(signal) > at
    gate = above if side == "above" else 1.0 - above
    return [replace(c, expression=c.expression * gate) for c in columns]


def comes_and_goes(shape: Shape) -> bool:
    """Whether a shape has knots in time or along the road, and so can follow any slow force."""
    return any("knots" in part for part in shape.settings.get("parts", [shape.settings]))


def merge(first: Shape, other: Shape) -> Shape:
    """One shape with the columns of both: a mechanism's true form may lie between two of its shapes.

    What is added starts from zero, not from the mean its own shape had.
    """
    parts = [*first.settings.get("parts", [first.settings]), other.settings]
    prior = Prior(
        np.zeros_like(other.prior.mean), other.prior.sd + abs(other.prior.mean) / 2, other.prior.sign
    )
    return Shape(
        first.mechanism,
        {"parts": parts},
        first.parts + other.parts,
        np.concatenate([first.columns, other.columns], axis=1),
        Prior.join(first.prior, prior),
        first.trials * other.trials,
    )


def shapes(mechanism: Mechanism, e: Evidence) -> list[Shape]:
    """Every shape of a mechanism on this evidence that is not zero throughout."""
    made = [shape(mechanism, settings, e) for settings in mechanism.settings(e)]
    return [s for s in made if np.abs(s.columns[e.valid]).max(initial=0.0) > 1e-6]


def shape(mechanism: Mechanism, settings: Settings, e: Evidence) -> Shape:
    """One shape of a mechanism on this evidence."""
    parts = build(mechanism, settings)
    columns = np.stack([p.expression.rows(e) for p in parts], axis=1)
    prior = Prior(*(np.array([getattr(p, f) for p in parts], dtype=float) for f in ("mean", "sd", "sign")))
    return Shape(mechanism, settings, tuple(parts), columns, prior, float(settings.get("trials", 1.0)))


def lever_reference(e: Evidence) -> float:
    """Median overall ratio (rad/m) while driving, so that columns in engine terms stay of order one."""
    if "ratio" not in e.signals:
        return 1.0
    ratio = e["ratio"][e.valid & np.isfinite(e["ratio"])]
    return max(float(np.median(ratio)), 1e-3) if len(ratio) else 1.0


def quantile(e: Evidence, x: Array, where: NDArray[np.bool_], q: float) -> float:
    """A quantile of x over valid rows that satisfy `where`; infinite when there are too few."""
    rows = e.valid & where & np.isfinite(x)
    return float(np.quantile(x[rows], q)) if rows.sum() > 50 else float("inf")


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
    always = [Column(carrier, 2.0 * s["sd"], name, unit, sign=sign, **told)] if steady else []
    unit_of_knots = "s" if s["along"] == "elapsed" else "m"
    return always + [
        Column(
            carrier * Knot(along, -1 if "shared" in s else i, k * s["knot"], s["knot"], s["mean"]),
            s["sd"],
            f"{name}[{i}, {k * s['knot']:.0f} {unit_of_knots}]",
            unit,
            sign=sign,
            **told,
        )
        for i, count in enumerate(s["knots"])
        for k in range(count)
    ]
