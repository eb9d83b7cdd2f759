"""Map of shared roads as SVG: each cell is a stroke along its heading, coloured by its slope."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

from deeptruck_model.mismatch.roads.shared_roads import CELL_DEG, CELL_M

EDGES = (-0.02, -0.005, 0.005, 0.02)  # slopes between the colours
LABELS = (
    f"below {100 * EDGES[0]:g} %",
    *(f"{100 * low:g} to {100 * high:g} %" for low, high in pairwise(EDGES)),
    f"above {100 * EDGES[-1]:g} %",
)
COLOURS = ("#0072B2", "#56B4E9", "#8a8a8a", "#E69F00", "#D55E00")  # Okabe and Ito's, for colour blindness too
WIDTH, MARGIN = 400.0, 8.0  # units of the drawing, which is drawn on a page as wide as there is room
LEAST_STROKE, ASIDE = 4.0, 1.5  # units: a cell is drawn so long at least, and so far right of its heading


def road_map(rows: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """The data of the map for rows of roads.csv: its `size`, a path for each colour, and its `km` from west
    to east and from north to south. At a scale at which cells overlap, each stroke is drawn once."""
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
