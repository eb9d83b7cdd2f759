"""roads.csv: slopes of roads that several trucks drove, by cells that are equal for every vehicle."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from deeptruck_core import reading
from deeptruck_core.errors import InputError
from deeptruck_core.signals import channel_of
from deeptruck_model.mismatch.prepare.one_road import STEP_M, headed
from deeptruck_model.mismatch.prepare.prepared import prepare
from deeptruck_model.mismatch.rules import Limits
from deeptruck_model.recordings import Recording

Array = NDArray[np.float64]
Cell = tuple[int, int, str]

CELL_M = 100.0
CELL_DEG = 0.0009  # of latitude: 99.5 m at the equator, 100.5 m at the poles
WAYS = "NESW"  # a passage has that of its mean heading: the other way along a road is another cell
GAP_M = 300.0  # between known cells, over which a slope is interpolated
FLEET_FIRST = "give roads.csv as 'deeptruck-model fleet roads' wrote it"


def cells(headed: Array) -> list[Cell]:
    """The cell at each step of a drive: latitude, longitude and heading, degrees, (n, 3). Cells are squares
    of about CELL_M; all steps of a passage through one have its mean heading."""
    latitude, longitude, heading = headed.T
    row = np.floor(latitude / CELL_DEG)
    column = np.floor(longitude * np.cos(np.radians((row + 0.5) * CELL_DEG)) / CELL_DEG)
    entered = (np.diff(row, prepend=row[:1]) != 0) | (np.diff(column, prepend=column[:1]) != 0)
    passage, radians = np.cumsum(entered), np.radians(heading)
    east, north = (np.bincount(passage, part) for part in (np.sin(radians), np.cos(radians)))
    way = np.floor((np.degrees(np.arctan2(east, north))[passage] + 45.0) / 90.0) % 4
    keys = np.stack([row, column, way], axis=1).astype(int).tolist()
    return [(r, c, WAYS[w]) for r, c, w in keys]


@dataclass(frozen=True)
class SharedRoads:
    """Slope, rise over run, by cell."""

    slopes: Mapping[Cell, float]
    advice: ClassVar[str] = "give recordings with positions on these roads"

    @staticmethod
    def read(path: Path) -> SharedRoads:
        """Read roads.csv. Raises InputError for a file with other content."""
        rows = csv.DictReader(io.StringIO(reading.text(path, FLEET_FIRST)))
        possible, slopes = channel_of("grade"), dict[Cell, float]()
        try:
            texts = [(rows.line_num, cell_named(row["cell"]), row["slope"].strip()) for row in rows]
        except (KeyError, AttributeError, ValueError, csv.Error):
            raise InputError(f"{path} is no table of shared roads; {FLEET_FIRST}") from None
        for line, cell, text in texts:
            where = f"{path}, line {line}: slope"
            slope = slopes[cell] = reading.number_in_cell(text, where, FLEET_FIRST)
            if not possible.low <= slope <= possible.high:
                raise InputError(f"{where} is {slope:g}, which no road has; {FLEET_FIRST}")
        if not slopes:
            raise InputError(f"{path} holds no slope; {FLEET_FIRST}")
        return SharedRoads(slopes)

    def along(self, recording: Recording) -> Array | None:
        """Slope (n,) of a recording, interpolated over gaps and NaN off the shared roads; None if less than
        Limits.least_road_km of it is known, or it has no positions."""
        p = prepare(recording, False)
        places = headed(p)
        if places is None:
            return None
        slope = np.array([self.slopes.get(cell, np.nan) for cell in cells(places)])
        known = np.flatnonzero(np.isfinite(slope))
        if len(known) * STEP_M < 1000.0 * Limits.least_road_km:
            return None
        driven = p.distance() - p.distance()[0]
        ahead = np.clip(np.searchsorted(known * STEP_M, driven), 1, len(known) - 1)
        before, after = known[ahead - 1] * STEP_M, known[ahead] * STEP_M
        near = (after - before <= GAP_M) & (driven >= before - STEP_M) & (driven <= after + STEP_M)
        return np.where(near, np.interp(driven, known * STEP_M, slope[known]), np.nan)


def cell_named(text: str) -> Cell:
    """The cell for a name in roads.csv. Raises ValueError for other text."""
    row, column, way = text.split(":")
    return int(row), int(column), way


def name_of_cell(cell: Cell) -> str:
    """The name of a cell in roads.csv."""
    return ":".join(map(str, cell))
