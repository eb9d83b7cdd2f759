"""Positions of drives along the roads that they share: by GPS, else by distance driven.

A force that depends on the road position acts on every drive that passes. Positions are metres along all
roads, one after the other; a later pass in the same direction has the positions of the first one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.spatial import cKDTree

from deeptruck_core.arrays import Array
from deeptruck_model.mismatch.prepare.prepared import Prepared, fill
from deeptruck_model.mismatch.rules import Limits
from deeptruck_model.recordings.units import metres_per_degree

STEP_M = 10.0
NEAR_M = 30.0  # of one road: two lanes and the error of an ordinary GPS
SMOOTH = 2.0  # steps over which a receiver's error is smoothed
APART_M = 500.0  # between two roads: knots of one do not reach the other
NOWHERE = -1.0  # the place of a drive without positions
CHORD_M, PIECE_M = 30.0, 600.0  # a receiver's error lengthens short chords, bends shorten long ones
LAP_M = 200.0  # a road that is met again sooner was not left


def on_one_road(drives: Sequence[Prepared]) -> tuple[Prepared, ...]:
    """The drives with their `road`, NOWHERE for those without GPS positions; unchanged if fewer than two have
    positions."""
    ways = [_way(p, _position(p)) if _positions(p) else None for p in drives]
    placed = [p for p, way in zip(drives, ways, strict=True) if way is not None and _as_driven(way)]
    if len(placed) < min(2, len(drives)):
        return tuple(drives)
    known, places, end, about = np.zeros((0, 4)), np.zeros(0), 0.0, _position(placed[0])
    out = []
    for p in drives:
        if not any(p is other for other in placed):
            out.append(replace(p, road=np.full(len(p.recording), NOWHERE)))
            continue
        way = _way(p, about)
        own = _placed(way, known, places, end)
        known, places = np.concatenate([known, way]), np.concatenate([places, own])
        end = float(places.max(initial=0.0)) + STEP_M
        out.append(replace(p, road=_between(p.distance(), own)))
    return tuple(out)


def _between(driven: Array, own: Array) -> Array:
    """The position at every row (n,) of a drive, interpolated between its steps (k,), but never across two
    roads."""
    if len(own) < 2:
        return np.full(len(driven), own[0])
    steps = np.maximum((driven - driven[0]) / STEP_M, 0.0)
    last = np.minimum(steps.astype(int), len(own) - 2)
    onward = np.diff(own)[last]
    goes_on = (onward >= 0.0) & (onward < NEAR_M)
    placed: Array = own[last] + (steps - last) * np.where(goes_on, onward, STEP_M)
    return placed


def without_a_place(drives: Sequence[Prepared]) -> list[str]:
    """Names of the drives whose positions are missing or implausible, if others have valid ones."""
    return [p.recording.name for p in drives if p.road is not None and (p.road == NOWHERE).all()]


def on_a_road_of_its_own(drives: Sequence[Prepared]) -> list[str]:
    """Names of the drives whose positions meet no other drive, if at least two others do."""
    placed = [p for p in drives if p.road is not None and (p.road != NOWHERE).any()]
    passed = [set(np.floor_divide(p.place(), STEP_M).tolist()) for p in placed]
    apart = [
        p.recording.name
        for k, p in enumerate(placed)
        if not any(passed[k] & other for j, other in enumerate(passed) if j != k)
    ]
    return apart if len(apart) < len(placed) else []


def _positions(p: Prepared) -> bool:
    channels = p.recording.channels
    return all(np.isfinite(channels.get(name, np.nan)).any() for name in ("latitude", "longitude"))


def _position(p: Prepared) -> tuple[float, float]:
    """The first latitude and longitude of a drive, degrees."""
    first = (p.recording.channels[name] for name in ("latitude", "longitude"))
    latitude, longitude = (float(x[np.isfinite(x)][0]) for x in first)
    return latitude, longitude


def _way(p: Prepared, about: tuple[float, float]) -> Array:
    """Every STEP_M of a drive: east and north of a position (m), and its heading as a vector of length
    NEAR_M, so that the opposite direction of a road is a different place, (k, 4)."""
    track = gaussian_filter1d(_track(p, about, STEP_M), SMOOTH, axis=1, mode="nearest")
    if track.shape[1] < 2:
        return np.concatenate([track, np.zeros_like(track)]).T
    heading = np.gradient(track, axis=1)
    length = np.maximum(np.hypot(*heading), 1e-6)
    return np.concatenate([track, NEAR_M * heading / length]).T


def _track(p: Prepared, about: tuple[float, float], step_m: float) -> Array:
    """East and north of a position at every step of the driven distance, m, (2, k)."""
    driven = p.distance()
    grid = np.arange(driven[0], driven[-1] + step_m, step_m)
    return np.stack([np.interp(grid, driven, x) for x in _metres(p, about)])


def _metres(p: Prepared, about: tuple[float, float]) -> tuple[Array, Array]:
    """East and north of a position (degrees), m, (n,) each. Longitude may cross 180 degrees."""
    latitude, longitude = about
    east = np.remainder(p.recording.channels["longitude"] - longitude + 180.0, 360.0) - 180.0
    north = p.recording.channels["latitude"] - latitude
    east_m, north_m = metres_per_degree(latitude)
    return east_m * fill(east), north_m * fill(north)


def driven_by_positions(p: Prepared) -> Array:
    """Ratio of the distance by recorded speed to that by positions, over every PIECE_M of a drive, (m,);
    empty without positions. Chords are not smoothed, because that would cut bends short."""
    if not _positions(p):
        return np.zeros(0)
    track = _track(p, _position(p), CHORD_M)
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(track, axis=1)))])
    gone = np.diff(along[:: round(PIECE_M / CHORD_M)])
    out: Array = PIECE_M / gone[gone > 0.0]
    return out


def _as_driven(way: Array) -> bool:
    """Whether the positions of a way (k, 4) have about the length of the driven distance; a receiver may have
    frozen."""
    gone = float(np.hypot(*np.diff(way[:, :2], axis=0).T).sum())
    return (
        gone > Limits.position_agrees * STEP_M * (len(way) - 1)
        and gone < STEP_M * (len(way) - 1) / Limits.position_agrees
    )


def _placed(way: Array, known: Array, places: Array, end: float) -> Array:
    """Position of every step of a way (k, 4): that of a known way nearby, else of its own earlier lap, else
    on a new road, which continues from `end` if the road's end was passed."""
    own = np.full(len(way), np.nan)
    if len(known):
        apart, nearest = cKDTree(known).query(way)
        own = np.where(apart < NEAR_M, places[nearest % len(known)], np.nan)
    laps = cKDTree(way).query_ball_point(way, NEAR_M)
    for k in np.flatnonzero(np.isnan(own)):
        earlier = [j for j in laps[k] if j < k - LAP_M / STEP_M]
        if earlier:
            own[k] = own[min(earlier, key=lambda j: float(np.sum((way[j] - way[k]) ** 2)))]
            continue
        goes_on = k > 0 and own[k - 1] >= end - NEAR_M
        own[k] = end if goes_on or end == 0.0 else end + APART_M
        end = own[k] + STEP_M
    return own
