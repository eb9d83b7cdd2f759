"""Speeds of the sixth world: planned along the way, between tolls, roundabouts, exits and bends."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from deeptruck_exam.hidden import Array, ou_series

CELL_M = 2.0


@dataclass(frozen=True)
class Kind:
    """cruise m/s with weights and metres of one; what lies between: m/s of passing it, metres of it, how
    often it has to be waited at; pull m/s2 from rest, power W/kg, easing m/s2 and braking m/s2."""

    cruise: tuple[float, ...]
    weights: tuple[float, ...]
    stretch_m: float
    pass_mps: tuple[float, float]
    pass_m: tuple[float, float]
    waits: float
    pull: tuple[float, float]
    power: tuple[float, float]
    brake: tuple[float, float]


KINDS = {  # motorway with tolls and narrows; roundabouts and barriers; country bends; a long way down
    "highway": Kind(
        (21.0, 22.5, 24.0, 25.0),
        (0.15, 0.25, 0.4, 0.2),
        1300.0,
        (15.0, 19.5),
        (60.0, 500.0),
        0.0,
        (0.3, 0.55),
        (4.0, 9.0),
        (0.3, 0.9),
    ),
    "suburban": Kind(
        (10.5, 12.5, 14.0, 16.0),
        (0.2, 0.3, 0.35, 0.15),
        260.0,
        (3.5, 7.5),
        (20.0, 70.0),
        0.4,
        (0.6, 1.0),
        (4.0, 9.0),
        (0.7, 1.5),
    ),
    "hills": Kind(
        (14.0, 17.0, 19.5, 22.0),
        (0.15, 0.3, 0.35, 0.2),
        550.0,
        (8.0, 14.0),
        (40.0, 220.0),
        0.06,
        (0.45, 0.8),
        (4.0, 8.0),
        (0.4, 1.1),
    ),
    "descent": Kind(
        (10.5, 13.0, 15.5, 17.5),
        (0.2, 0.3, 0.3, 0.2),
        330.0,
        (7.0, 11.0),
        (40.0, 150.0),
        0.03,
        (0.4, 0.7),
        (4.0, 8.0),
        (0.4, 1.0),
    ),
}


def _limits(rng: np.random.Generator, kind: Kind, metres: float) -> tuple[Array, Array]:
    """Speed (cells,) that each place allows, and seconds (cells,) that are waited there."""
    n = round(metres / CELL_M) + 1
    limit, waits, at = np.empty(n), np.zeros(n), 0
    own = rng.normal(1.0, 0.02)
    while at < n:
        end = at + round((40.0 + rng.gamma(2.0, kind.stretch_m / 2.0)) / CELL_M)
        limit[at:end] = min(float(rng.choice(kind.cruise, p=kind.weights)) * own, 27.0)
        at = end + max(1, round(rng.uniform(*kind.pass_m) / CELL_M))
        limit[end:at] = rng.uniform(*kind.pass_mps)
        if rng.random() < kind.waits and end < n:
            limit[end], waits[end] = 0.0, 2.0 + rng.gamma(2.0, 3.0)
    return limit, waits


def _plan(limit: Array, pull: float, power: float, brake: float) -> Array:
    """Speed over the way that meets every limit: backwards by braking, forwards by pull and power."""
    speed = limit.copy()
    for k in range(len(speed) - 2, -1, -1):
        speed[k] = min(speed[k], np.sqrt(speed[k + 1] ** 2 + 2.0 * brake * CELL_M))
    for k in range(1, len(speed)):
        most = min(pull, power / max(speed[k - 1], 1.0))
        speed[k] = min(speed[k], np.sqrt(speed[k - 1] ** 2 + 2.0 * most * CELL_M))
    return speed


def speed_profile(rng: np.random.Generator, scenario: str, n: int, dt: float) -> Array:
    """Speed a driver has in mind, (n,) m/s."""
    kind = KINDS[scenario]
    limit, waits = _limits(rng, kind, 30.0 * n * dt)
    brake = rng.uniform(*kind.brake)
    over_way = _plan(limit, rng.uniform(*kind.pull), rng.uniform(*kind.power), brake)
    mean = np.maximum(0.5 * (over_way[1:] + over_way[:-1]), 0.25)
    clock = np.concatenate([[0.0], np.cumsum(CELL_M / mean + waits[:-1])])
    leaves = clock[:-1] + waits[:-1]  # a stop is a place with two times
    times = np.stack([clock[:-1], leaves], axis=1).ravel()
    speed = np.interp(np.arange(n) * dt, times, np.repeat(over_way[:-1], 2))
    wander = 0.2 * np.convolve(ou_series(rng, (1, n), dt, 14.0)[0], np.hanning(61) / 30.0, mode="same")
    speed = speed + wander * np.clip(speed / 7.0 - 0.4, 0.0, 1.0)
    ease = np.hanning(17) / np.hanning(17).sum()
    padded = np.pad(speed, 8, mode="edge")
    floor = 14.3 if scenario == "highway" else 0.0
    return np.asarray(np.clip(np.convolve(padded, ease, mode="valid"), floor, 27.5))
