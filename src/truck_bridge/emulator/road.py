"""The slope of the emulated truck's road, from a command-line argument."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable
from pathlib import Path

from deeptruck_core.reading import check_file
from truck_bridge.errors import InputError

STEEPEST = 0.5  # rise/run


def road(text: str) -> Callable[[float], float]:
    """Slope (rise/run) over distance (m), from a number or a table; constant beyond the table's ends.

    Raises InputError for any other text.
    """
    try:
        slope = float(text)
    except ValueError:
        return _of_file(text)
    within(f"--grade {text}", slope, -STEEPEST, STEEPEST)
    return lambda distance: slope


def within(what: str, value: float, low: float, high: float) -> None:
    """Raises InputError for a value outside the range, NaN included."""
    if not low <= value <= high:
        raise InputError(f"{what} must be a number from {low:g} to {high:g}, not {value:g}")


def _of_file(text: str) -> Callable[[float], float]:
    from deeptruck_model.recordings.tables.table_file import read_curve

    check_file(Path(text), "give a number or a table as --grade")
    distances, slopes = (column.tolist() for column in read_curve(Path(text), "distance", "grade"))
    for slope in slopes:
        within(f"{text}: grade", slope, -STEEPEST, STEEPEST)

    def slope_at(distance: float) -> float:
        after = bisect_right(distances, distance)
        if after in (0, len(distances)):
            return slopes[min(after, len(slopes) - 1)]
        low, high = distances[after - 1], distances[after]
        share = (distance - low) / (high - low)
        return slopes[after - 1] + share * (slopes[after] - slopes[after - 1])

    return slope_at
