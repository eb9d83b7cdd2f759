"""Speeds that bends and junctions allow: planned along the way by what a driver likes to feel aside."""

from __future__ import annotations

import numpy as np

from deeptruck_exam.effects.law import Array
from deeptruck_exam.effects.series import ou_series
from deeptruck_exam.worlds.traffic import FLOOR, KINDS, Kind, allowed, finish

CELL_M = 4.0
SLOWEST_MPS = 4.5  # in the tightest bend
RADII_M = {"highway": 420.0, "suburban": 60.0, "hills": 130.0, "descent": 90.0}  # of the tighter bends


def bendy(rng: np.random.Generator, scenario: str, n: int, dt: float) -> Array:
    """Reymond, Kemeny, Droulez and Berthoz, Role of Lateral Acceleration in Curve Driving, Human Factors 43
    (2001): drivers bear the less lateral acceleration the faster they go; and the harder a bend, the less
    they brake or pull in it. Radii and what trucks bear are chosen here."""
    kind, floor = KINDS[scenario], FLOOR.get(scenario, 0.0)
    bend = _bends(rng, RADII_M[scenario], 28.0 * n * dt)
    bears = rng.uniform(1.3, 2.2)  # m/s2, when slow
    limit = np.minimum(_signs(rng, kind, len(bend)), _through(bend, bears))
    waits = _junctions(rng, kind, limit)
    grip = np.sqrt(np.clip(1.0 - (limit**2 * bend / bears) ** 2, 0.2, 1.0))
    _ease(limit, grip * rng.uniform(*kind.slow), grip * rng.uniform(*kind.pull))
    return finish(rng, _in_time(limit, waits, n, dt), dt, 0.25, 11.0, floor)


def _bends(rng: np.random.Generator, radius_m: float, metres: float) -> Array:
    """Curvature (cells,), 1/m, never negative: long straights, and bends of all radii."""
    cells = round(metres / CELL_M) + 50
    slow, fast = (ou_series(rng, (1, cells), CELL_M, own)[0] for own in (5.0 * radius_m, 1.2 * radius_m))
    bend = np.abs(0.7 * slow + 0.7 * fast) ** 1.6 / (1.8 * radius_m)
    return np.asarray(np.convolve(bend, np.hanning(15) / np.hanning(15).sum(), mode="same"))


def _signs(rng: np.random.Generator, kind: Kind, cells: int) -> Array:
    """Speed (cells,) that the signs allow, each for a stretch."""
    out, at = np.empty(cells), 0
    while at < cells:
        end = at + round((80.0 + rng.exponential(1.5 * kind.stretch_m)) / CELL_M)
        out[at:end], at = min(allowed(rng, kind), 27.0), end
    return out


def _through(bend: Array, bears: float) -> Array:
    """Speed at which a bend is as hard as is borne: v^2 * bend = bears * (1 - v / 45)."""
    tight = np.maximum(bend, 1e-6)
    half = bears / 90.0
    return np.maximum((np.sqrt(half**2 + tight * bears) - half) / tight, SLOWEST_MPS)


def _junctions(rng: np.random.Generator, kind: Kind, limit: Array) -> Array:
    """Seconds (cells,) that are waited; some junctions are only rolled through."""
    waits, at = np.zeros(len(limit)), 0.0
    while (
        kind.lights_m > 0.0
        and (at := at + kind.lights_m * rng.uniform(0.4, 1.6)) < CELL_M * len(limit) - 40.0
    ):
        here = int(at / CELL_M)
        stops = rng.random() < max(kind.stops, 0.25)
        limit[here : here + 4] = 0.0 if stops else np.minimum(limit[here : here + 4], rng.uniform(2.5, 6.0))
        limit[here + 1 : here + 4] = np.maximum(limit[here + 1 : here + 4], 1.5)
        waits[here] = 2.0 + rng.gamma(2.0, 3.5) if stops else 0.0
    return waits


def _ease(limit: Array, brake: Array, pull: Array) -> None:
    """Backwards by braking, forwards by pulling."""
    for k in range(len(limit) - 2, -1, -1):
        limit[k] = min(limit[k], np.sqrt(limit[k + 1] ** 2 + 2.0 * brake[k] * CELL_M))
    for k in range(1, len(limit)):
        most = min(pull[k], 7.0 / max(limit[k - 1], 1.0))
        limit[k] = min(limit[k], np.sqrt(limit[k - 1] ** 2 + 2.0 * most * CELL_M))


def _in_time(limit: Array, waits: Array, n: int, dt: float) -> Array:
    """Speed (n,) by the clock, from speed by the way."""
    mean = np.maximum(0.5 * (limit[1:] + limit[:-1]), 0.25)
    clock = np.concatenate([[0.0], np.cumsum(CELL_M / mean + waits[:-1])])[:-1]
    times = np.stack([clock, clock + waits[:-1]], axis=1).ravel()  # a stop is a place with two times
    return np.interp(np.arange(n) * dt, times, np.repeat(limit[:-1], 2))
