"""Merges the slopes that several trucks recovered on the same road cells, into roads.csv and roads.json.

A simulator without a grade input leaves the slope in its residual. The residual of one truck in a cell, over
its passages, gives one estimate of the slope there. It includes the effects of that truck's errors in mass,
drag and rolling resistance, which differ between trucks; trucks are therefore pooled as studies with
different means (DerSimonian and Laird, Controlled Clinical Trials 7, 1986).
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.stats import t as student

from deeptruck_model.fleet.compare import folder, receipts
from deeptruck_model.fleet.slopes import COLUMNS, SLOPES, mean_heading, written
from deeptruck_model.fleet.slopes import NUMBERS as SLOPE_NUMBERS
from deeptruck_model.fleet.statistics import pooled
from deeptruck_model.fleet.storage import Place, code, key
from deeptruck_model.mismatch.slopes import CELL_DEG, CELL_M

ROADS, TABLE = "roads.json", "roads.csv"
NUMBERS = ("latitude", "longitude", "heading", "slope", "low", "high", "trucks", "drives")
MERGED = ("cell", *NUMBERS)
LEAST_TRUCKS = 2  # of a shared cell
INTERVAL = 0.9
EARLIER = "it was compared by an earlier version, which kept no slopes"
EDGES = (-0.02, -0.005, 0.005, 0.02)  # slopes between the colours
LABELS = (
    f"below {100 * EDGES[0]:g} %",
    *(f"{100 * low:g} to {100 * high:g} %" for low, high in pairwise(EDGES)),
    f"above {100 * EDGES[-1]:g} %",
)
COLOURS = ("#0072B2", "#56B4E9", "#8a8a8a", "#E69F00", "#D55E00")  # Okabe and Ito's, for colour blindness too
WIDTH, MARGIN = 400.0, 8.0  # units of the drawing, which is drawn on a page as wide as there is room
LEAST_STROKE, ASIDE = 4.0, 1.5  # units: a cell is drawn so long at least, and so far right of its heading


def merged(trucks: Mapping[str, Sequence[Mapping[str, Any]]]) -> list[dict[str, Any]]:
    """Merge the slopes of several trucks: one row with columns MERGED for each cell that at least
    LEAST_TRUCKS of them drove, from each truck's rows with columns SLOPES."""
    by_cell: dict[str, dict[str, list[Mapping[str, Any]]]] = {}
    for truck, rows in sorted(trucks.items()):
        for row in rows:
            by_cell.setdefault(row["cell"], {}).setdefault(truck, []).append(row)
    out = []
    for cell, passed in sorted(by_cell.items()):
        if len(passed) < LEAST_TRUCKS:
            continue
        own = [np.array([(r["slope"], r["variance"]) for r in rows]) for rows in passed.values()]
        mean = pooled([x[:, 0].mean() for x in own], [x[:, 1].sum() ** 0.5 / len(x) for x in own])
        half = float(student.ppf(0.5 + INTERVAL / 2, len(own) - 1)) * mean.error
        rows = [r for each in passed.values() for r in each]
        heading = mean_heading(np.array([r["heading"] for r in rows]))
        where = {c: float(np.mean([r[c] for r in rows])) for c in ("latitude", "longitude")}
        sizes = {"slope": mean.mean, "low": mean.mean - half, "high": mean.mean + half}
        out.append(
            {"cell": cell, "heading": heading, "trucks": len(own), "drives": len(rows)} | where | sizes
        )
    return out


def roads(target: Place) -> dict[str, Any]:
    """Pool the slopes of all trucks and write roads.csv, then roads.json, whose content is returned. Files
    are not rewritten if the receipts have not changed. Raises InputError if no truck was compared."""
    compared = {r["truck"]: r for r in receipts(target) if "quarantined" not in r}
    own = key(code(), sorted((truck, r["key"]) for truck, r in compared.items()))
    if target.exists(ROADS) and target.exists(TABLE) and (known := target.read_json(ROADS))["key"] == own:
        return known
    left_out = {
        t: r.get("no_slopes", EARLIER) for t, r in compared.items() if SLOPES not in r.get("files", ())
    }
    trucks = {
        t: target.read_table(f"{folder(t)}/{SLOPES}", COLUMNS, SLOPE_NUMBERS)
        for t in compared
        if t not in left_out
    }
    rows = merged(trucks)
    shared = {row["cell"] for row in rows}
    half = [(row["high"] - row["low"]) / 2 for row in rows]
    out = {
        "key": own,
        "km": round(len(rows) * CELL_M / 1000.0, 1),
        "trucks": sum(any(row["cell"] in shared for row in own) for own in trucks.values()),
        "half_width": float(np.median(half)) if half else None,
        "left_out": dict(sorted(left_out.items())),
    }
    target.write(TABLE, written(MERGED, rows))
    target.write_json(ROADS, out)
    return out


def said(found: Mapping[str, Any]) -> str:
    """The main sentence of roads.json: the length of shared road, counting both directions, or why there is
    none."""
    left_out = "; ".join(
        f"{n} truck{'s' * (n > 1)} left out, each because {why}"
        for why, n in Counter(found["left_out"].values()).items()
    )
    if not found["km"]:
        return f"No road is shared: {left_out or 'no cell was driven by two trucks'}."
    shared = f"{found['km']:g} km of road and direction are shared by {found['trucks']} trucks"
    half = f"the slope is known to ±{100 * found['half_width']:.2g} % (90 % interval, median)"
    return f"{shared}; {half}{'; ' if left_out else ''}{left_out}."


def road_map(rows: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """The data of a map as SVG, in which each cell is a stroke along its heading, for rows of roads.csv: its
    `size`, a path for each colour, and its `km` from west to east and from north to south. At a scale at
    which cells overlap, each stroke is drawn once."""
    first = rows[0]["longitude"]
    cos_latitude = math.cos(math.radians(sum(r["latitude"] for r in rows) / len(rows)))
    x = [((r["longitude"] - first + 180.0) % 360.0 - 180.0) * cos_latitude for r in rows]
    y = [-r["latitude"] for r in rows]
    extent = [max(v) - min(v) for v in (x, y)]  # degrees of latitude
    scale = (WIDTH - 2 * MARGIN) / max(*extent, CELL_DEG)
    half = max(CELL_DEG * scale, LEAST_STROKE) / 2
    strokes: list[dict[str, None]] = [{} for _ in COLOURS]
    for row, east, south in zip(rows, x, y, strict=True):
        heading = math.radians(row["heading"])
        right, down = math.sin(heading), -math.cos(heading)
        at = (
            MARGIN + (east - min(x)) * scale - down * ASIDE,
            MARGIN + (south - min(y)) * scale + right * ASIDE,
        )
        begin = f"M{at[0] - right * half:.1f} {at[1] - down * half:.1f}"
        stroke = f"{begin}l{2 * right * half:.1f} {2 * down * half:.1f}"
        strokes[sum(row["slope"] > edge for edge in EDGES)][stroke] = None
    colours = zip(COLOURS, LABELS, map("".join, strokes), strict=True)
    return {
        "size": [f"{2 * MARGIN + v * scale:.0f}" for v in extent],
        "km": [f"{(v / CELL_DEG + 1) * CELL_M / 1000.0:.1f}" for v in extent],
        "colours": list(colours),
    }
