"""Uses the recovered slope as the grade of its recordings.

A learned truck trained without slopes has absorbed part of them, so adding the slope to it does not help. A
truck trained again with these recordings has the slope as an input.
"""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from deeptruck_core.errors import InputError
from deeptruck_model.mismatch.folders import FIND_FIRST, PROFILE, check_road
from deeptruck_model.mismatch.rules import Limits
from deeptruck_model.recordings import Recording

Array = NDArray[np.float64]


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
