"""What the explorer draws, as one JSON text: block means of every drive, and what is told of each finding."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from deeptruck_model.mismatch.posterior import modelled
from deeptruck_model.mismatch.posterior.free_law import features
from deeptruck_model.mismatch.report import headline, names
from deeptruck_model.mismatch.report.drawing import colour, drawn, label, usual_reach
from deeptruck_model.mismatch.report.explorer.curves import Curve, curve
from deeptruck_model.mismatch.report.given import as_given
from deeptruck_model.mismatch.report.regime_figure import telling_pair
from deeptruck_model.mismatch.report.wording import opened, percent
from deeptruck_model.mismatch.residual.evidence import Evidence, Stretch
from deeptruck_model.mismatch.result import Mismatch, Segment
from deeptruck_model.recordings import Recording

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Json = dict[str, Any]

BLOCK_S = 1.0
MOST_BLOCKS = 20000  # of all drives together: five hours and a half at one second
DIGITS, DEGREES = 4, 5  # significant digits of a mean; decimals of a position, which are a metre
AXES = (  # what the map may be drawn over, where it is known; the last two tell how hot brakes are
    "speed", "engine", "brake", "grade", "gear", "braking power over 60 s", "time since braking",
)  # fmt: skip
NOTABLE = 0.02  # of the largest residual: below it nobody sees that two lines differ
TRIED = ("before", "parameters_only", "after")


def of(m: Mismatch) -> Json:
    """All that the scripts read."""
    e = m.evidence
    return _compared(m, e) if e is not None and m.explanation is not None else _driven(m)


def text(content: Json) -> str:
    """It as JSON that can stand within a page's script element."""
    written = json.dumps(content, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    return written.replace("<", "\\u003c")


@dataclass(frozen=True)
class Blocks:
    """Blocks of `per` rows each; the last of a drive is left out where it is not whole."""

    per: int
    dt: float

    @staticmethod
    def of(seconds: float, dt: float) -> Blocks:
        """Of a second, or longer where all drives together are too long for the page."""
        block = max(BLOCK_S, seconds / MOST_BLOCKS)
        return Blocks(max(1, int(np.ceil(block / dt - 1e-9))), dt)

    @property
    def seconds(self) -> float:
        return self.per * self.dt

    def cut(self, x: Array) -> Array:
        """Rows (n,) as (blocks, per)."""
        return x[: len(x) // self.per * self.per].reshape(-1, self.per)

    def mean(self, x: Array) -> Array:
        """Means of what is known in each block; NaN where nothing is."""
        parts = self.cut(x)
        known = np.isfinite(parts)
        total = np.where(known, parts, 0.0).sum(axis=1)
        out: Array = np.where(known.any(axis=1), total / np.maximum(known.sum(axis=1), 1), np.nan)
        return out

    def ends(self, x: Array) -> tuple[Array, Array]:
        """Lowest and highest of what is known in each block; NaN where nothing is."""
        parts = self.cut(x)
        none = ~np.isfinite(parts).any(axis=1)
        low = np.where(np.isfinite(parts), parts, np.inf).min(axis=1, initial=np.inf)
        high = np.where(np.isfinite(parts), parts, -np.inf).max(axis=1, initial=-np.inf)
        return np.where(none, np.nan, low), np.where(none, np.nan, high)


@dataclass(frozen=True)
class _Forces:
    """Forces of all rows (n,) in the unit that is drawn; NaN where nothing is compared."""

    unit: str
    residual: Array
    explained: Array
    each: tuple[Array | None, ...]  # by finding


def _compared(m: Mismatch, e: Evidence) -> Json:
    assert m.explanation is not None
    scale = drawn(e, e.newtons(np.ones(len(e))) / e.mass)[0]
    moved = modelled.retuned(e)
    residual, explained = e.residual + moved, modelled.told(e, m.explanation)
    known = np.where(e.valid, scale, np.nan)
    causes = [f.cause for f in m.result.findings]
    forces = _Forces(
        drawn(e, e.residual)[1], residual * known, explained * known,
        tuple(None if c is None else c.force * known for c in causes),
    )  # fmt: skip
    blocks = Blocks.of(len(e) * e.dt, e.dt)
    axes = _axes(e)
    left = residual - explained
    curves = [curve(e, m.explanation, f, left, scale) for f in m.result.findings]
    return {
        "unit": forces.unit,
        "block_s": round(blocks.seconds, 3),
        "row_s": round(e.dt, 3),
        "reach": _reach(e, blocks, forces),
        "explains": any(c is not None for c in causes),
        "refitted": _beside(forces),
        "axes": {n: label(n, e.command_units) for n in axes},
        "pair": _pair(e, residual, axes),
        "drives": [_drive(e, s, blocks, forces, axes) for s in e.stretches],
        "findings": [_finding(m, k, c) for k, c in enumerate(curves)],
        "held_out": _held_out(m, e),
    }


def _reach(e: Evidence, blocks: Blocks, forces: _Forces) -> float:
    """Half the height of what shows forces, in their unit."""
    every = [[blocks.mean(x[s.rows]) for s in e.stretches] for x in (forces.residual, forces.explained)]
    return max(usual_reach(*every), LEAST_REACH)


def _beside(forces: _Forces) -> bool:
    """Whether more is explained than the findings say one by one: what refitted parameters take."""
    each = [np.nan_to_num(x) for x in forces.each if x is not None]
    more = np.nan_to_num(forces.explained) - np.sum(each, axis=0) if each else np.zeros(1)
    return bool(
        np.abs(more).max(initial=0.0) > NOTABLE * np.abs(np.nan_to_num(forces.residual)).max(initial=0.0)
    )


def _axes(e: Evidence) -> dict[str, Array]:
    """Signals (n,) that the map may be drawn over."""
    known = features(e)
    return {n: np.nan_to_num(known[n]) for n in AXES if n in known and np.ptp(known[n]) > 0}


def _pair(e: Evidence, residual: Array, axes: Mapping[str, Array]) -> list[str]:
    """The two axes that tell most of the residual."""
    y, columns, _ = modelled.averaged(e, residual, list(axes))
    if len(y) < 60 or len(axes) < 2:
        return list(axes)[:2]
    try:
        return list(telling_pair(y, columns))
    except ValueError:  # no two of them vary enough
        return list(axes)[:2]


def _drive(e: Evidence, s: Stretch, blocks: Blocks, f: _Forces, axes: Mapping[str, Array]) -> Json:
    low, high = blocks.ends(f.residual[s.rows])
    distance = (e["distance"][s.rows] - e["distance"][s.start]) / 1000.0
    columns = {
        "speed": blocks.mean(e["speed"][s.rows]),
        "distance": blocks.mean(distance),
        "residual": blocks.mean(f.residual[s.rows]),
        "low": low,
        "high": high,
        "explained": blocks.mean(f.explained[s.rows]),
        "simulated": blocks.mean(e.simulated[s.rows]),
    }
    columns |= {n: blocks.mean(x[s.rows]) for n, x in axes.items()}
    columns |= {f"force{k}": blocks.mean(x[s.rows]) for k, x in enumerate(f.each) if x is not None}
    columns |= _position({n: e.signals[n][s.rows] for n in POSITION if n in e.signals}, blocks)
    return _rounded(s.name, s.start_s, s.held_out, columns)


LEAST_REACH = 1e-3  # kN, or m/s^2
POSITION = ("latitude", "longitude")


def _position(known: Mapping[str, Array], blocks: Blocks) -> dict[str, Array]:
    both = len(known) == len(POSITION) and all(np.isfinite(x).any() for x in known.values())
    return {n: blocks.mean(x) for n, x in known.items()} if both else {}


def _driven(m: Mismatch) -> Json:
    """Where nothing could be compared: what was driven."""
    given = as_given(m.prepared)
    dt = given[0].dt if given else 1.0
    blocks = Blocks.of(sum(len(r) * r.dt for r in given), dt)
    return {
        "unit": "",
        "block_s": round(blocks.seconds, 3),
        "row_s": round(dt, 3),
        "reach": 0.0,
        "explains": False,
        "refitted": False,
        "axes": {},
        "pair": [],
        "drives": [_as_recorded(r, blocks) for r in given],
        "findings": [_finding(m, k, None) for k in range(len(m.result.findings))],
        "held_out": [],
    }


def _as_recorded(r: Recording, blocks: Blocks) -> Json:
    speed = r.channels["speed"]
    columns = {
        "speed": blocks.mean(speed),
        "distance": blocks.mean(np.cumsum(np.nan_to_num(speed)) * r.dt / 1000.0),
    }
    columns |= _position({n: r.channels[n] for n in POSITION if n in r.channels}, blocks)
    return _rounded(r.name, r.start_s, False, columns)


def _rounded(name: str, start_s: float, held_out: bool, columns: Mapping[str, Array]) -> Json:
    return {
        "name": name,
        "start_s": round(start_s, 2),
        "held_out": held_out,
        "columns": {n: _numbers(x, decimals=DEGREES if n in POSITION else None) for n, x in columns.items()},
    }


def _numbers(x: Array, decimals: int | None = None) -> list[float | int | None]:
    """Rounded, in as few characters as that takes; None where nothing is known."""
    return [_number(float(v), decimals) if np.isfinite(v) else None for v in x]


def _number(v: float, decimals: int | None) -> float | int:
    short = round(v, decimals) if decimals is not None else float(f"{v:.{DIGITS}g}")
    short = 0.0 if abs(short) < 1e-9 else short
    return int(short) if short == int(short) and abs(short) < 1e9 else short


def _finding(m: Mismatch, k: int, c: Curve | None) -> Json:
    f = m.result.findings[k]
    return {
        "name": opened(names.group(headline.name(f))),
        "sure": percent(f.probability),
        "colour": colour(k),
        "force": f.cause is not None and m.evidence is not None,
        "segments": _segments(m.evidence, m.result.segments, k) if m.evidence is not None else [],
        "curve": None if c is None else _curve(c),
    }


def _segments(e: Evidence, found: Sequence[Segment], k: int) -> list[list[float]]:
    """Drive, beginning and end (s) of each stretch of a finding, without ends where nothing is compared."""
    out: list[list[float]] = []
    for s in found:
        rows = s.start + np.flatnonzero(e.valid[s.start : s.stop])
        if s.finding != k or not len(rows):
            continue
        drive = int(e.record[s.start])
        begin = e.stretches[drive].start_s - e.stretches[drive].start * e.dt
        out.append([drive, round(begin + rows[0] * e.dt, 1), round(begin + (rows[-1] + 1) * e.dt, 1)])
    return out


def _curve(c: Curve) -> Json:
    arrays = {"x": c.x, "force": c.force, "low": c.low, "high": c.high, "seen": c.seen, "error": c.seen_error}
    numbers = {n: None if x is None else _numbers(x) for n, x in arrays.items()}
    return {"by": c.by, "share": percent(c.share), **numbers}


def _held_out(m: Mismatch, e: Evidence) -> list[Json]:
    """Speed errors of free runs on each held-out drive, rms in m/s, by simulator."""
    if not m.errors or not len(m.errors["before"].speed):
        return []
    drives = [i for i, s in enumerate(e.stretches) if s.held_out]
    tried = [n for n in TRIED if n in m.errors]
    out = []
    for k, drive in enumerate(drives):
        own = {n: m.errors[n].speed[m.errors[n].recording == k] for n in tried}
        if all(len(x) for x in own.values()):
            rms = {
                n: float(np.sqrt(np.mean(x**2))) for n, x in own.items()
            }  # rounded once, where it is shown
            out.append({"drive": drive, "runs": len(own["before"]), "rms": rms})
    return out
