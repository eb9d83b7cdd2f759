"""Aligns the sides of a comparison: by the clock, and along a shared road."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from scipy.signal import correlate
from scipy.spatial import cKDTree

from deeptruck_core.arrays import Array
from deeptruck_model.compare.sides import Side
from deeptruck_model.recordings.units import metres_per_degree

LEAST_SHARED = 0.5  # of the shorter side, that an offset must leave to compare
AGREES = 0.8  # correlation of speeds below which no offset is accepted: drives of other roads reach 0.6
SIGNIFICANT = 8.0  # standard deviations: unrelated drives reached 6.5 in 334 trials, pieces of one 35
NEARLY = 0.002  # of correlation: a leader that repeats itself agrees with itself at several offsets
NEAR_M = 30.0  # two lanes and the error of an ordinary GPS
LEAST_M = 500.0  # of shared road
BIN_M, LEAST_ROAD_M = 25.0, 3000.0  # shorter profiles of slopes agree by chance
SAME_ROAD = 0.95  # correlation of two of them


class By(StrEnum):
    """How an offset was determined."""

    LEADER = "leader's speed"
    SPEED = "speed"
    GIVEN = "given"
    ONE_BAG = "one bag"  # a simulator along the bag that it is compared with
    NOTHING = "nothing"  # no offset was significant


@dataclass(frozen=True)
class Offset:
    """Time shift that aligns a side with the first one, s, and how well the two agree.

    `correlation` is that of the leaders' speeds if these were used, otherwise of their own; if no offset was
    significant, that of the best one.
    """

    seconds: float
    correlation: float
    by: By

    @property
    def found(self) -> bool:
        """Whether the offset was estimated from the recordings."""
        return self.by in (By.LEADER, By.SPEED)


def offset(first: Side, other: Side) -> Offset:
    """The shift at which the leaders' speeds agree best, if both sides have a leader, otherwise their own
    speeds.

    Two followers of one leader differ in their delay, which their own speeds would not show.
    """
    followed = all("leader_speed" in s.columns for s in (first, other))
    channels = {"leader_speed": By.LEADER, "speed": By.SPEED} if followed else {"speed": By.SPEED}
    correlation = 0.0
    for channel, by in channels.items():
        pair = _Pair.of(first, other, channel)
        shift, correlation = pair.best() if pair.known else (0, 0.0)
        if correlation >= AGREES and pair.beyond_chance(shift) > SIGNIFICANT:
            return Offset(shift * first.step_s, correlation, by)
    return Offset(0.0, correlation, By.NOTHING)


@dataclass(frozen=True)
class _Pair:
    """The speeds of two sides minus their common mean, 0 where unknown; and 1 where known."""

    a: Array
    b: Array
    a_known: Array
    b_known: Array

    @staticmethod
    def of(first: Side, other: Side, channel: str) -> _Pair:
        each = [s.columns[channel] for s in (first, other)]
        a_known, b_known = (np.isfinite(x) for x in each)
        both = np.concatenate(each)[np.concatenate([a_known, b_known])]
        a, b = (np.nan_to_num(x - (both.mean() if len(both) else 0.0)) for x in each)
        return _Pair(a, b, a_known.astype(float), b_known.astype(float))

    @property
    def known(self) -> bool:
        return bool(self.a_known.any() and self.b_known.any())

    def best(self) -> tuple[int, float]:
        """The best shift in samples, and its correlation, among all shifts that overlap by half of the
        shorter side.

        Of nearly equal peaks, the one nearest to a common start is chosen.
        """
        number = correlate(self.a_known, self.b_known)
        squares = correlate(self.a**2, self.b_known) * correlate(self.a_known, self.b**2)
        agreement = correlate(self.a, self.b) / np.sqrt(np.maximum(squares, 1e-12))
        enough = number >= LEAST_SHARED * min(self.a_known.sum(), self.b_known.sum())
        agreement = np.where(enough, agreement, -1.0)
        begun = len(self.b) - 1
        alike = [k for k in _peaks(agreement) if agreement[k] >= agreement.max() - NEARLY]
        best = min(alike, key=lambda k: abs(k - begun))
        return best - begun, float(agreement[best])

    def beyond_chance(self, shift: int) -> float:
        """Significance of the agreement of speed changes, in standard deviations (Fisher's z). A short
        segment resembles many others in speed, but not in the times of its changes."""
        begin, end = max(shift, 0), min(len(self.a), shift + len(self.b))
        theirs = slice(begin - shift, end - shift)
        both = (self.a_known[begin:end] * self.b_known[theirs]) > 0.0
        changes = [np.diff(x)[both[1:] & both[:-1]] for x in (self.a[begin:end], self.b[theirs])]
        if len(changes[0]) < 2 or min(float(np.std(x)) for x in changes) == 0.0:
            return 0.0
        pieces = len(changes[0]) / max(_renewed_after(x - x.mean()) for x in changes)
        agree = min(float(np.corrcoef(changes[0], changes[1])[0, 1]), 1.0 - 1e-12)
        return float(np.arctanh(agree) * np.sqrt(max(pieces - 3.0, 0.0)))


def _renewed_after(x: Array) -> float:
    """Samples after which the autocorrelation of a centred signal is below a half, so that it holds new
    information."""
    own = correlate(x, x)[len(x) - 1 :]
    return float(np.argmax(own < 0.5 * own[0])) or float(len(x))


def _peaks(x: Array) -> list[int]:
    """Indices of local maxima."""
    wider = np.concatenate([[-np.inf], x, [-np.inf]])
    return [int(k) for k in np.flatnonzero((x >= wider[:-2]) & (x >= wider[2:]))]


@dataclass(frozen=True)
class Road:
    """Position of a side along the road of the first one, m, NaN elsewhere, and how it was determined."""

    place: Array
    by: str
    shared_m: float


NO_ROAD = "No shared road: {why}"


def road(first: Side, other: Side) -> Road | str:
    """The shared road, by positions if both sides have them, otherwise by slopes; a sentence if no road is
    shared."""
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
    """East and north coordinates relative to the centre of `about`, m, (n, 2)."""
    east_m, north_m = metres_per_degree(float(np.nanmean(about.columns["latitude"])))
    return np.stack([east_m * side.columns["longitude"], north_m * side.columns["latitude"]], axis=1)


def _by_slope(first: Side, other: Side) -> Road | str:
    a, b = _slopes(first), _slopes(other)
    least = int(LEAST_ROAD_M / BIN_M)
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
    """Mean slope in each BIN_M of distance; 0 where unknown."""
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
    """The road, if most of it is driven in the same direction; opposite directions cannot be aligned by
    distance."""
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
