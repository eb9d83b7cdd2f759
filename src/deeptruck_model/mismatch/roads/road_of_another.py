"""Uses the slope recovered from one vehicle's residual as the grade of another vehicle's recordings.

Both slopes were recovered without a recorded grade. If they agree over 6 km better than by chance, the other
vehicle drove the same road, and its slope there is evidence independent of this vehicle's residual.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from deeptruck_model.errors import InputError
from deeptruck_model.mismatch.roads.recovered_road import Roads
from deeptruck_model.mismatch.roads.windows import (
    LENGTH_M,
    STEP_M,
    WIDTH,
    Windows,
    similarity,
    steps,
    turned,
)
from deeptruck_model.mismatch.rules import Limits
from deeptruck_model.recordings import Recording

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

NEAR = 5  # steps by which places may differ that are one: wheels and curves measure a road a little otherwise


@dataclass(frozen=True)
class Shared:
    """Windows that lie on another vehicle's road: their indices (a,), the other's slope in this driving
    direction (a, WIDTH), and whether the other drove in the opposite direction (a,)."""

    windows: Indices
    slope: Array
    reverse: NDArray[np.bool_]


@dataclass(frozen=True)
class Covered:
    """Kilometres of a recording on the other vehicle's road, `turned_km` of them in the opposite
    direction."""

    name: str
    km: float
    same_way_km: float
    turned_km: float

    def __str__(self) -> str:
        if not self.same_way_km + self.turned_km:
            return f"{self.name}: none of its {self.km:.1f} km is on a road of the other"
        return (
            f"{self.name}: {self.same_way_km:.1f} of {self.km:.1f} km are on a road that the other drove the "
            f"same way, {self.turned_km:.1f} the other way"
        )


def shared(own: Windows, other: Windows) -> Shared:
    """Find the windows of `own` in those of `other`.

    Each window votes for the position with which it agrees best, if the agreement exceeds the largest one of
    the two comparisons that no road can cause. On a shared road, successive windows vote for the same offset;
    Limits.road_shared is the number of votes beyond chance.
    """
    a, b = own.centred(), other.centred()
    if not len(a) or not len(b):
        return Shared(np.zeros(0, dtype=np.intp), np.zeros((0, WIDTH)), np.zeros(0, dtype=bool))
    pairs = Votes(own, other, similarity(a, b), -1.0), Votes(own, other, similarity(turned(a), b), 1.0)
    none = Votes(own, other, similarity(-a, b), -1.0), Votes(own, other, similarity(-turned(a), b), 1.0)
    limit = max(float(v.best.max()) for v in none)
    same, back = (np.where(v.votes(limit) >= Limits.road_shared, v.best, -1.0) for v in pairs)
    reverse = back > same
    found = np.flatnonzero(np.maximum(same, back) > limit)
    slope = other.values[np.where(reverse, pairs[1].place, pairs[0].place)[found]]
    return Shared(found, np.where(reverse[found, None], turned(slope), slope), reverse[found])


class Votes:
    """For each window (a,): the position of best agreement, the agreement there, and the number of other
    windows that vote for the same offset."""

    def __init__(self, own: Windows, other: Windows, alike: Array, way: float) -> None:
        """`alike` (a, b); `way` is 1 if the distances run in opposite directions, else -1."""
        self.place: Indices = alike.argmax(axis=1)
        self.best: Array = alike.max(axis=1)
        apart = np.round((own.at + way * other.at[self.place]) / (NEAR * STEP_M)).astype(int)
        keys = np.stack([own.profile, other.profile[self.place], apart], axis=1)
        self._same = np.unique(keys, axis=0, return_inverse=True)[1].reshape(-1)

    def votes(self, limit: float) -> Indices:
        """Votes (a,), counted only among windows that agree better than `limit`; others have none."""
        counts = self.best > limit
        out: Indices = np.bincount(self._same, weights=counts)[self._same].astype(np.intp) * counts
        return out


def with_road_of_another(
    roads: Roads, other: Roads, recordings: Sequence[Recording]
) -> tuple[list[Recording], list[Covered]]:
    """The pieces of `recordings` on roads that the other vehicle drove too, with its slope as their grade;
    and the covered distance of each recording.

    `roads` are the recordings' own recovered slopes, by which positions are found. Raises InputError if a
    recording has a grade, no slope was recovered for any, or no road is shared.
    """
    graded = [r.name for r in recordings if "grade" in r.channels]
    if graded:
        raise InputError(f"recording '{graded[0]}' has a grade of its own; give recordings without one")
    sloped = [(r, slope) for r in recordings if (slope := roads.along(r)) is not None]
    if not sloped:
        raise InputError("no slope was found for these recordings; give those that mismatch was run on")
    along = [_distance(r) for r, _ in sloped]
    own = Windows.of([(d, slope) for d, (_, slope) in zip(along, sloped, strict=True)])
    found = shared(own, Windows.of([(t.distance, t.slope) for t in other.slopes.values()]))
    pieces, covered = [], []
    for i, (recording, _) in enumerate(sloped):
        grid = steps(along[i])
        slope, turned_share = _overlaid(own, found, i, grid)
        known = np.isfinite(slope)
        km = STEP_M / 1000.0 * int(known.sum())
        back = STEP_M / 1000.0 * float(turned_share[known].sum())
        covered.append(Covered(recording.name, along[i][-1] / 1000.0, km - back, back))
        pieces += _pieces(recording, along[i], grid, slope)
    if not pieces:
        raise InputError(
            f"no {LENGTH_M / 1000:.0f} km of these recordings agree with the other road better than chance; "
            "give drives that share a road, with a slope of their own that was recovered well"
        )
    return pieces, covered


def _distance(recording: Recording) -> Array:
    out: Array = np.cumsum(np.nan_to_num(recording.channels["speed"])) * recording.dt
    return out


def _overlaid(own: Windows, found: Shared, i: int, grid: Array) -> tuple[Array, Array]:
    """At the positions `grid` (m,) of profile i: the median slope of the windows that cover it, NaN without
    any, and the share of them driven in the other direction."""
    mine = own.profile[found.windows] == i
    first = np.round((own.at[found.windows[mine]] - grid[0]) / STEP_M).astype(int) if mine.any() else []
    stack = np.full((int(mine.sum()), len(grid)), np.nan)
    back = np.zeros_like(stack)
    for row, (at, slope, reverse) in enumerate(
        zip(first, found.slope[mine], found.reverse[mine], strict=True)
    ):
        stack[row, at : at + WIDTH] = slope
        back[row, at : at + WIDTH] = reverse
    seen = np.isfinite(stack)
    count = np.maximum(seen.sum(axis=0), 1)
    out = np.full(len(grid), np.nan)
    some = seen.any(axis=0)
    if some.any():
        out[some] = np.nanmedian(stack[:, some], axis=0)
    return out, back.sum(axis=0) / count


def _pieces(recording: Recording, distance: Array, grid: Array, slope: Array) -> list[Recording]:
    """The recording's pieces along which the slope is known, with that slope as grade."""
    known = np.concatenate([[False], np.isfinite(slope), [False]])
    begin, end = np.flatnonzero(~known[:-1] & known[1:]), np.flatnonzero(known[:-1] & ~known[1:])
    out = []
    for first, last in zip(begin, end, strict=True):
        start, stop = np.searchsorted(distance, [grid[first], grid[last - 1]])
        piece = recording.piece(int(start), int(stop))
        grade = np.interp(distance[start:stop], grid[first:last], slope[first:last])
        channels = piece.channels | {"grade": grade}
        out.append(replace(piece, channels=channels, interface=replace(piece.interface, grade=True)))
    return out
