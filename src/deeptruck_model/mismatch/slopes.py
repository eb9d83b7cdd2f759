"""Slopes that were recovered, by one vehicle or several, as the grade of recordings.

A learned truck trained without slopes has absorbed part of them, so adding the slope to it does not help. A
truck trained again with these recordings has the slope as an input.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import ClassVar, Protocol

import numpy as np

from deeptruck_core import reading
from deeptruck_core.arrays import Array
from deeptruck_core.errors import InputError
from deeptruck_core.signals import channel_of
from deeptruck_model.mismatch.folders import FIND_FIRST, PROFILE, check_road
from deeptruck_model.mismatch.prepare.places import STEP_M, headed
from deeptruck_model.mismatch.prepare.prepared import prepare
from deeptruck_model.mismatch.rules import Limits
from deeptruck_model.recordings import Recording


class Slopes(Protocol):
    """Recovered slopes; `advice` is shown for recordings to which they do not belong."""

    advice: ClassVar[str]

    def along(self, recording: Recording) -> Array | None:
        """Slope (n,) of a recording, NaN where unknown; None if hardly any is known."""


@dataclass(frozen=True)
class RecoveredSlope:
    """The slope recovered along a recording: time since its bag began (s), distance since the recording began
    (m), and slope, (m,) each."""

    time: Array
    distance: Array
    slope: Array


@dataclass(frozen=True)
class Roads:
    """The recovered slopes, by the recording's name."""

    slopes: Mapping[str, RecoveredSlope]
    advice: ClassVar[str] = "give those that mismatch was run on"

    @staticmethod
    def read(found: Path) -> Roads:
        """The slopes in profiles.csv of a folder that `mismatch` wrote.

        Raises InputError if there are none.
        """
        check_road(found)
        try:
            with (found / "profiles.csv").open(newline="") as file:
                rows = [row for row in csv.DictReader(file) if row["name"] == PROFILE]
            places_of: dict[str, list[list[float]]] = {}
            for row in rows:
                place = [float(row[name]) for name in ("time_s", "distance_m", "value")]
                places_of.setdefault(row["recording"], []).append(place)
        except (OSError, KeyError, TypeError, ValueError):
            raise InputError(f"{found} has no readable profiles.csv; {FIND_FIRST}") from None
        slopes = {name: RecoveredSlope(*np.array(places).T) for name, places in places_of.items()}
        twice = [name for name, there in slopes.items() if (np.diff(there.time) <= 0.0).any()]
        if twice:
            raise InputError(
                f"in {found} two recordings are called '{twice[0]}'; rename a bag and run mismatch again"
            )
        return Roads(slopes)

    def along(self, recording: Recording) -> Array | None:
        """Slope (n,) of a recording, interpolated over gaps; None if hardly any was recovered."""
        if recording.name not in self.slopes:
            return None
        time, slope = self.slopes[recording.name].time, self.slopes[recording.name].slope
        elapsed = recording.dt * np.arange(len(recording))
        inside = (time >= recording.start_s) & (time <= recording.start_s + elapsed[-1])
        if inside.sum() < Limits.least_road_s:
            return None
        distance = np.cumsum(np.nan_to_num(recording.channels["speed"])) * recording.dt
        there = np.interp(time[inside] - recording.start_s, elapsed, distance)
        return np.interp(distance, there, slope[inside])


def with_road(roads: Slopes, recordings: Sequence[Recording]) -> tuple[list[Recording], list[str]]:
    """The recordings with their slope as grade, and the names of those for which none was recovered.

    Raises InputError if a recording has a grade, two are of different trucks, or none has a slope.
    """
    signals = [replace(r.interface, name="", mass_kg=None) for r in recordings]
    others = [r.name for r, own in zip(recordings, signals, strict=True) if own != signals[0]]
    if others:
        raise InputError(
            f"'{others[0]}' and '{recordings[0].name}' have other signals or units; give drives of one truck"
        )
    graded = [r.name for r in recordings if "grade" in r.channels]
    if graded:
        raise InputError(f"recording '{graded[0]}' has a grade of its own; give recordings without one")
    slopes = [roads.along(r) for r in recordings]
    out = [
        replace(r, channels=r.channels | {"grade": s}, interface=replace(r.interface, grade=True))
        for r, s in zip(recordings, slopes, strict=True)
        if s is not None
    ]
    if not out:
        raise InputError(f"no slope was found for these recordings; {roads.advice}")
    return out, [r.name for r, s in zip(recordings, slopes, strict=True) if s is None]


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
