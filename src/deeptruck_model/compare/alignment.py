"""What moment of one side belongs to what moment of another: by the clock, and along a shared road."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import correlate
from scipy.spatial import cKDTree

from deeptruck_model.compare.sides import Side

Array = NDArray[np.float64]

LEAST_SHARED = 0.5  # of the shorter side, that an offset must leave to compare
AGREES = 0.8  # correlation of speeds below which no offset is believed: drives of other roads reach 0.6
EARTH_M = 6371e3
NEAR_M = 30.0  # two lanes and the error of an ordinary GPS
LEAST_M = 500.0  # of shared road
BIN_M, TELLS_M = 25.0, 3000.0  # shorter profiles of slopes agree by chance
SAME_ROAD = 0.95  # correlation of two of them


@dataclass(frozen=True)
class Offset:
    """By how much a side is moved to meet the first one, s, and the correlation of the speeds there.

    `found` is False where the user gave it, or where no offset is believed and it is 0.
    """

    seconds: float
    correlation: float
    found: bool


def offset(first: Side, other: Side) -> Offset:
    """The shift at which the speeds agree best, of all that leave half of the shorter side to compare."""
    a, b = (_centred(s.columns["speed"]) for s in (first, other))
    number = correlate(a[1], b[1])
    product = correlate(a[0], b[0])
    size = np.sqrt(np.maximum(correlate(a[0] ** 2, b[1]) * correlate(a[1], b[0] ** 2), 1e-12))
    enough = number >= LEAST_SHARED * min(a[1].sum(), b[1].sum())
    agreement = np.where(enough, product / size, -1.0)
    best = int(np.argmax(agreement))
    seconds, correlation = (best - (len(b[0]) - 1)) * first.step_s, float(agreement[best])
    if correlation < AGREES:
        return Offset(0.0, correlation, False)
    return Offset(float(seconds), correlation, True)


def _centred(speed: Array) -> tuple[Array, Array]:
    """Speeds about their mean, 0 where unknown; and 1 where known."""
    known = np.isfinite(speed)
    middle = float(np.mean(speed[known])) if known.any() else 0.0
    return np.where(known, speed - middle, 0.0), known.astype(float)


@dataclass(frozen=True)
class Road:
    """Where a side is on the way of the first one, m, NaN where it is elsewhere; how that is known."""

    place: Array
    by: str
    shared_m: float


NO_ROAD = "No shared road: {why}"


def road(first: Side, other: Side) -> Road | str:
    """By positions where both have them, else by the slopes; a sentence where no road is shared."""
    if all("latitude" in s.columns and "longitude" in s.columns for s in (first, other)):
        return _by_position(first, other)
    if all({"grade", "elevation"} & s.columns.keys() for s in (first, other)):
        return _by_slope(first, other)
    return NO_ROAD.format(why="neither positions nor slopes are recorded on both")


def _by_position(first: Side, other: Side) -> Road | str:
    here, there = (_metres(s, first) for s in (first, other))
    known, asked = (np.isfinite(p).all(axis=1) for p in (here, there))
    if not known.any() or not asked.any():
        return NO_ROAD.format(why="a side has no valid position")
    apart, nearest = cKDTree(here[known]).query(there[asked])
    place = np.full(len(other), np.nan)
    place[asked] = np.where(apart < NEAR_M, first.distance[known][nearest], np.nan)
    return _forward(place, other, "positions")


def _metres(side: Side, about: Side) -> Array:
    """East and north of the middle of `about`, m, (n, 2)."""
    latitude, longitude = (np.radians(side.columns[c]) for c in ("latitude", "longitude"))
    middle = float(np.nanmean(np.radians(about.columns["latitude"])))
    return EARTH_M * np.stack([np.cos(middle) * longitude, latitude], axis=1)


def _by_slope(first: Side, other: Side) -> Road | str:
    a, b = _slopes(first), _slopes(other)
    least = int(TELLS_M / BIN_M)
    if min(len(a), len(b)) < least or min(float(np.std(a)), float(np.std(b))) < 1e-3:
        return NO_ROAD.format(why="too short or too level to know a road by its slopes")
    ones_a, ones_b = np.ones(len(a)), np.ones(len(b))
    number = np.maximum(correlate(ones_a, ones_b), 1.0)
    mean_a, mean_b = correlate(a, ones_b) / number, correlate(ones_a, b) / number
    product = correlate(a, b) / number - mean_a * mean_b
    spread = (correlate(a**2, ones_b) / number - mean_a**2) * (correlate(ones_a, b**2) / number - mean_b**2)
    agreement = np.where(number >= least, product / np.sqrt(np.maximum(spread, 1e-12)), -1.0)
    best = int(np.argmax(agreement))
    if agreement[best] < SAME_ROAD:
        return NO_ROAD.format(why=f"slopes agree nowhere (correlation {agreement[best]:.2f} at best)")
    place = other.distance + (best - (len(b) - 1)) * BIN_M
    inside = (place >= 0.0) & (place <= first.distance[-1])
    return _forward(np.where(inside, place, np.nan), other, "slopes")


def _slopes(side: Side) -> Array:
    """Mean slope of every BIN_M of the way; 0 where unknown."""
    distance = side.distance
    edges = np.arange(0.0, distance[-1] + 1e-9, BIN_M)
    if "grade" in side.columns and np.isfinite(side.columns["grade"]).any():
        known = np.isfinite(side.columns["grade"])
        return np.interp(edges, distance[known], side.columns["grade"][known])
    known = np.isfinite(side.columns["elevation"])
    if not known.any():
        return np.zeros(len(edges))
    return np.asarray(np.gradient(np.interp(edges, distance[known], side.columns["elevation"][known]), BIN_M))


def _forward(place: Array, other: Side, by: str) -> Road | str:
    """The road, if most of it is driven the same way: by distance nothing can be told of the other way."""
    known = np.isfinite(place)
    steps = np.diff(place[known])
    if known.sum() < 2 or np.abs(steps).sum() < LEAST_M:
        return NO_ROAD.format(why=f"less than {LEAST_M:.0f} m by {by}")
    if steps.sum() < 0.0:
        return NO_ROAD.format(why=f"the same road by {by}, but the other way")
    forward = place.copy()
    forward[known] = np.maximum.accumulate(place[known])
    moving = np.diff(other.distance[known])
    return Road(forward, by, float(moving[moving < 10 * NEAR_M].sum()))
