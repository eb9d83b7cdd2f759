"""Infers a column's unit by consistency with columns whose units are known."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from deeptruck_model.recordings.earth import metres_per_degree
from deeptruck_model.recordings.units import conversion

Array = NDArray[np.float64]

WINDOW_S = 1.0  # over which rates of change are taken
CLIMB_S = 10.0  # the same for heights, whose steps are coarse
TRAVELLED = "travelled"  # key of columns of distance, in m
LEAST = 30  # windows that a comparison needs
CORRELATION = 0.7
SLOPE = (0.85, 1.18)  # of the reference over the column, in SI; units differ by 1.15 (mph, knot) and more
TOP_GEAR = 2.8  # rad of the crankshaft for a metre: fewer no road vehicle has in its highest gear

Known = Mapping[str, list[tuple[str, Array]]]  # channel -> (column, values (n,) in SI)


def fitting(channel: str, units: list[str], values: Array, time: Array, known: Known) -> tuple[str, str]:
    """The unit among `units` in which `values` (n,) agree with the known columns, and the column they agree
    with; '' if there is none.

    `time` (n,) is in s. Each pair of `_pairs` holds two measures of one quantity, from the column's values
    and from other columns.
    """
    for what, mine, other in _pairs(channel, values, time, known):
        found = [unit for unit in units if unit and _agree(conversion(channel, unit)(mine), other)]
        if len(found) == 1:
            return found[0], f"{found[0]} by agreement with {what}"
    left = list(units)
    if channel == "speed":
        for what, engine in known.get("engine_speed", []):
            moving = (values > 0.4 * np.nanmax(values)) & (engine > 0.0)
            if moving.sum() >= LEAST and np.quantile(engine[moving] / values[moving], 0.05) < TOP_GEAR:
                left = [unit for unit in left if unit != "m/s"]
                if len(left) == 1:
                    return left[0], f"no m/s by the engine speed in '{what}', so {left[0]}"
    return "", ""


def _pairs(channel: str, values: Array, time: Array, known: Known) -> Iterator[tuple[str, Array, Array]]:
    speeds = known.get("speed", [])
    if channel == "speed":
        for name, other in speeds:
            yield f"'{name}'", values, other
        for name, other in known.get("acceleration", []):
            yield f"the acceleration in '{name}'", *_over(WINDOW_S, time, change=values, mean=other)
        for name, travelled in known.get(TRAVELLED, []):
            pace, mean = _over(CLIMB_S, time, change=travelled, mean=values)
            yield f"the distance in '{name}'", mean, pace
        for (lat_name, lat), (_, lon) in zip(
            known.get("latitude", []), known.get("longitude", []), strict=False
        ):
            east_m, north_m = metres_per_degree(lat)
            north, east = lat * north_m, lon * east_m
            moving = np.where(values > 0.0, values, np.nan)  # receivers show 0 for what they do not know
            north, mean = _over(CLIMB_S, time, change=north, mean=moving)
            east, _ = _over(CLIMB_S, time, change=east, mean=moving)
            yield f"the positions in '{lat_name}'", mean, np.hypot(north, east)
    elif channel == "acceleration":
        for name, other in speeds:
            rise, mean = _over(WINDOW_S, time, change=other, mean=values)
            yield f"the speed in '{name}'", mean, rise
    elif channel == "grade":
        for name, height in known.get("elevation", []):
            for _, speed in speeds:
                climb, mean = _over(CLIMB_S, time, change=height, mean=values)
                _, pace = _over(CLIMB_S, time, change=height, mean=speed)
                yield (
                    f"the height in '{name}'",
                    mean,
                    np.where(pace > 2.0, climb / np.fmax(pace, 2.0), np.nan),
                )


def _over(window_s: float, time: Array, *, change: Array, mean: Array) -> tuple[Array, Array]:
    """The rate of `change` over windows and the mean of `mean` in them."""
    filled = np.isfinite(time) & np.isfinite(change) & np.isfinite(mean)
    t, x, y = time[filled], change[filled], mean[filled]
    if len(t) < 3:
        return np.zeros(0), np.zeros(0)
    k = max(1, round(window_s / max(float(np.median(np.diff(t))), 1e-6)))
    if len(t) <= k:
        return np.zeros(0), np.zeros(0)
    area = np.concatenate([[0.0], np.cumsum(np.diff(t) * (y[1:] + y[:-1]) / 2.0)])
    span = t[k:] - t[:-k]
    usual = (span > 0.0) & (span < 3.0 * window_s + 3.0)
    return ((x[k:] - x[:-k]) / span)[usual], ((area[k:] - area[:-k]) / span)[usual]


def _agree(mine: Array, other: Array) -> bool:
    both = np.isfinite(mine) & np.isfinite(other)
    x, y = mine[both], other[both]
    if len(x) < LEAST or x.std() == 0.0 or y.std() == 0.0:
        return False
    slope = float(x @ y) / float(x @ x)
    return float(np.corrcoef(x, y)[0, 1]) > CORRELATION and SLOPE[0] < slope < SLOPE[1]
