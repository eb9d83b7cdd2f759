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
from deeptruck_model.mismatch.expression import Expression, InRecording, Signal, Tent, maximum
from deeptruck_model.mismatch.noise import Prior

Array = NDArray[np.float64]
Settings = dict[str, Any]  # plain JSON values

SPEED, ENGINE, BRAKE = Signal("speed"), Signal("engine"), Signal("brake")
DRAG, ROLLING = Signal("drag"), Signal("rolling")
ELAPSED, DISTANCE, SIMULATED = Signal("elapsed"), Signal("distance"), Signal("simulated")
ENGINE_COMMAND, BRAKE_COMMAND = Signal("engine_command"), Signal("brake_command")
ENGINE_SPEED, RATIO, GEAR = Signal("engine_speed"), Signal("ratio"), Signal("gear")
MANY_SHAPES = 20  # something that comes and goes as it likes can stand in for much else; it pays for that
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
        return [c for part in settings["parts"] for c in build(mechanism, part)]
    columns = mechanism.build(settings)
    if "gate" not in settings:
        return columns
    signal, side, at = settings["gate"]
    x = Signal(signal)
    gate = x > at if side == "above" else x < at
    return [replace(c, expression=c.expression * gate) for c in columns]


def gates(e: Evidence) -> list[tuple[str, str, float]]:
    """Regimes to which an effect may be confined: (signal, above or below, value)."""
    out = []
    for name in ("speed", "ratio", "grade", "engine"):
        if e.has(name):
            for q in (0.3, 0.5, 0.7):
                at = float(np.nanquantile(e[name][e.valid], q))
                out += [(name, "above", at), (name, "below", at)]
    return out


def gated(shape: Shape, gate: tuple[str, str, float], e: Evidence, trials: int) -> Shape:
    """The shape confined to a regime, for an effect that acts only uphill, only at speed."""
    signal, side, at = gate
    x = np.nan_to_num(e[signal])
    inside = x > at if side == "above" else x < at
    settings = shape.settings | {"gate": list(gate)}
    parts = tuple(build(shape.mechanism, settings))
    return Shape(
        shape.mechanism, settings, parts, shape.columns * inside[:, None], shape.prior, shape.trials * trials
    )


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
    out = []
    for settings in mechanism.settings(e):
        parts = build(mechanism, settings)
        columns = np.stack([p.expression.rows(e) for p in parts], axis=1)
        seen = np.abs(columns[e.valid]).max(axis=0, initial=0.0) > 1e-6
        if not seen.any():
            continue
        prior = Prior(
            *(np.array([getattr(p, f) for p in parts], dtype=float) for f in ("mean", "sd", "sign"))
        )
        out.append(
            Shape(mechanism, settings, tuple(parts), columns, prior, float(settings.get("trials", 1.0)))
        )
    return out


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


def episode_settings(e: Evidence, knot_s: float = 60.0, most: int = 80) -> Settings:
    """Knots in time, afresh in every recording, for something that comes and goes."""
    return {"knots": share_out(durations(e), knot_s, most), "knot_s": knot_s, "trials": MANY_SHAPES}


def episodes(s: Settings) -> Iterator[tuple[str, Expression]]:
    """A name and a tent in time for every knot of `episode_settings`."""
    for i, count in enumerate(s["knots"]):
        for k in range(count + 1):
            yield (
                f"[{i}, {k * s['knot_s']:.0f} s]",
                InRecording(i) * Tent((ELAPSED,), k * s["knot_s"], s["knot_s"]),
            )
