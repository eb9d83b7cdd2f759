"""The slope under the emulated truck, from one word of the command line."""

from __future__ import annotations

import csv
from bisect import bisect_right
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

from truck_bridge.errors import InputError

STEEPEST = 0.5  # rise/run


def road(text: str) -> Callable[[float], float]:
    """Slope (rise/run) over distance (m), from a number or a CSV file; constant beyond the file's ends.

    Raises InputError where it is neither.
    """
    try:
        slope = float(text)
    except ValueError:
        return _of_file(text)
    within(f"--grade {text}", slope, -STEEPEST, STEEPEST)
    return lambda distance: slope


def within(what: str, value: float, low: float, high: float) -> None:
    """Raises InputError for a value outside, NaN included."""
    if not low <= value <= high:
        raise InputError(f"{what} must be a number from {low:g} to {high:g}, not {value:g}")


def _of_file(text: str) -> Callable[[float], float]:
    distances, slopes = _rows(text)
    for slope in slopes:
        within(f"{text}: grade", slope, -STEEPEST, STEEPEST)
    if not all(after > before for before, after in pairwise(distances)):
        raise InputError(f"{text}: distance must be numbers that grow from row to row")

    def slope_at(distance: float) -> float:
        after = bisect_right(distances, distance)
        if after in (0, len(distances)):
            return slopes[min(after, len(slopes) - 1)]
        low, high = distances[after - 1], distances[after]
        share = (distance - low) / (high - low)
        return slopes[after - 1] + share * (slopes[after] - slopes[after - 1])

    return slope_at


def _rows(text: str) -> tuple[list[float], list[float]]:
    try:
        with Path(text).open(newline="") as file:
            rows = [(float(row["distance"]), float(row["grade"])) for row in csv.DictReader(file)]
    except OSError as error:
        raise InputError(f"--grade {text}: {error.strerror}; give a number or a CSV file") from None
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(f"{text}: needs numeric columns distance and grade ({error})") from None
    if not rows:
        raise InputError(f"{text} holds no rows")
    return [distance for distance, _ in rows], [slope for _, slope in rows]
