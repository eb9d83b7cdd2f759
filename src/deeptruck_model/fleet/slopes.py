"""Slopes of one truck: the residual of a simulator without a grade input, by cells of road."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from deeptruck_core.arrays import Array
from deeptruck_core.constants import GRAVITY
from deeptruck_core.errors import InputError
from deeptruck_model.mismatch.prepare.places import STEP_M, headed
from deeptruck_model.mismatch.prepare.prepared import Prepared
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.slopes import CELL_M, Cell, cells, name_of_cell

SLOPES = "slopes.csv"
NUMBERS = ("latitude", "longitude", "heading", "slope", "variance")
COLUMNS = ("cell", *NUMBERS, "drive")
LEAST_M = 50.0  # that a drive has in a cell: less is a corner of it
LEAST_AGAIN = 10  # passages beyond the first of their cell, from which a truck's variance is estimated
NO_POSITIONS = "no positions are recorded that fit the speed"
HAS_GRADE = "its simulator takes the recorded slope"
LEARNED = "its simulator was learned, and has learned part of the slopes"
ONCE = (
    f"less than {LEAST_AGAIN * CELL_M / 1000.0:g} km of road is driven more than once, "
    "so that its variance is not known"
)


def slopes(e: Evidence, drives: Sequence[Prepared]) -> list[dict[str, Any]]:
    """Slope of each cell by each drive, with columns COLUMNS: minus the residual force over the weight,
    averaged over the distance in the cell. The variance is that between passages of this truck through a
    cell, pooled over cells.

    Raises InputError with the reason if the truck's slopes cannot be used.
    """
    if "grade" in drives[0].recording.interface.w:
        raise InputError(HAS_GRADE)
    if not e.known_physics:
        raise InputError(LEARNED)
    slope, metres = -e.newtons(e.residual) / e.mass / GRAVITY, e["speed"] * e.dt
    out: dict[tuple[Cell, str], list[tuple[float, ...]]] = {}
    for s, p in zip(e.drives, drives, strict=True):
        places = headed(p)
        if places is None:
            continue
        rows = np.flatnonzero(e.valid[s.rows]) + s.start
        step = ((e["distance"][rows] - p.distance()[0]) / STEP_M).astype(int).clip(0, len(places) - 1)
        drive, along = s.name.partition("#")[0], cells(places)
        for row, k in zip(rows.tolist(), step.tolist(), strict=True):
            out.setdefault((along[k], drive), []).append((metres[row], slope[row], *places[k]))
    if not out:
        raise InputError(NO_POSITIONS)
    found: dict[Cell, list[dict[str, Any]]] = {}
    for (cell, drive), passed in sorted(out.items()):
        m, value, latitude, longitude, heading = np.array(passed).T
        if m.sum() >= LEAST_M:
            here = {"cell": name_of_cell(cell), "latitude": latitude.mean(), "longitude": longitude.mean()}
            here |= {"heading": mean_heading(heading), "slope": m @ value / m.sum(), "drive": drive}
            found.setdefault(cell, []).append(here)
    again = sum(len(rows) - 1 for rows in found.values())
    if again < LEAST_AGAIN:
        raise InputError(ONCE)
    between = sum(len(rows) * np.var([row["slope"] for row in rows]) for rows in found.values()) / again
    return [row | {"variance": between} for rows in found.values() for row in rows]


def mean_heading(degrees: Array) -> float:
    """Circular mean of headings (n,), degrees."""
    return float(np.degrees(np.angle(np.exp(1j * np.radians(degrees)).sum())) % 360.0)


def written(columns: Sequence[str], rows: Iterable[Mapping[str, Any]]) -> bytes:
    """A table as CSV, positions to 0.1 m and other numbers to six digits."""
    text = io.StringIO()
    out = csv.writer(text, lineterminator="\n")
    out.writerow(columns)
    for row in rows:
        out.writerow([_text(c, row[c]) for c in columns])
    return text.getvalue().encode()


def _text(column: str, value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.6f}" if column in ("latitude", "longitude") else f"{value:.6g}"
    return str(value)
