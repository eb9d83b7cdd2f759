"""Speeds of a proving ground: runs of test procedures, one after the other, as a driver's aid shows them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from deeptruck_exam.effects.law import Array
from deeptruck_exam.worlds.traffic import finish

Run = tuple[float, float, str]
"""Speed m/s at its end, seconds it takes, and how it goes there: line, pull, coast or hold."""


def _constant_speeds(rng: np.random.Generator) -> list[Run]:
    """Fuel consumption runs: a speed, a coast down into the next, a pull."""
    high, low = rng.uniform(21.0, 24.3), rng.uniform(15.5, 19.0)
    middle = rng.uniform(18.0, 22.5)
    runs = [(high, rng.uniform(10.0, 35.0), "hold"), (low, (high - low) / rng.uniform(0.1, 0.35), "coast")]
    runs += [(low, rng.uniform(4.0, 18.0), "hold"), (middle, rng.uniform(12.0, 30.0), "pull")]
    slow = rng.uniform(14.8, 16.5)
    runs += [(slow, (middle - slow) / rng.uniform(0.4, 0.9), "line")][: rng.integers(2)]
    return [*runs, (high, rng.uniform(15.0, 40.0), "pull")]


def _short_trips(rng: np.random.Generator) -> list[Run]:
    """A trip of a transient cycle: pull, ripple, half a stop or a whole one."""
    top = rng.uniform(8.0, 16.5)
    runs = [(top, top / rng.uniform(0.4, 0.85), "pull"), (top, rng.uniform(3.0, 16.0), "hold")]
    if rng.random() < 0.5:
        dip = top * rng.uniform(0.35, 0.75)
        runs += [(dip, (top - dip) / rng.uniform(0.4, 1.1), "line"), (top, (top - dip) / 0.5, "pull")]
        runs.append((top, rng.uniform(2.0, 9.0), "hold"))
    runs.append((0.0, max(top, 2.0) / rng.uniform(0.7, 1.5), "line"))
    return [*runs, (0.0, rng.uniform(2.0, 9.0), "hold")]


def _over_the_hills(rng: np.random.Generator) -> list[Run]:
    """A durability lap: speeds by the lap's signs, held over its hills."""
    runs: list[Run] = []
    at = rng.uniform(11.0, 20.0)
    for _ in range(3):
        to = rng.uniform(11.0, 21.0)
        way = "pull" if to > at else "line" if rng.random() < 0.6 else "coast"
        pace = rng.uniform(0.12, 0.3) if way == "coast" else rng.uniform(0.25, 0.75)
        runs += [(to, max(abs(to - at), 1.0) / pace, way), (to, rng.uniform(8.0, 40.0), "hold")]
        at = to
    return runs


def _snubs(rng: np.random.Generator) -> list[Run]:
    """Brake runs downhill: held for a while, then snubs from one speed to another."""
    high, low = rng.uniform(14.5, 18.5), rng.uniform(7.0, 11.0)
    runs: list[Run] = [(high, rng.uniform(8.0, 20.0), "pull"), (high, rng.uniform(15.0, 50.0), "hold")]
    for _ in range(int(rng.integers(2, 6))):
        runs.append((low, (high - low) / rng.uniform(0.6, 1.4), "line"))
        runs.append((high, (high - low) / rng.uniform(0.25, 0.5), "line"))
    slow = rng.uniform(9.0, 13.0)
    return [*runs, (slow, (high - slow) / 0.5, "line"), (slow, rng.uniform(15.0, 45.0), "hold")]


PROCEDURES: dict[str, tuple[Callable[[np.random.Generator], list[Run]], float]] = {  # and least m/s
    "highway": (_constant_speeds, 14.3),
    "suburban": (_short_trips, 0.0),
    "hills": (_over_the_hills, 0.0),
    "descent": (_snubs, 0.0),
}


def _shape(way: str, share: Array) -> Array:
    """How much of the change is done after a share of the time."""
    if way == "pull":  # power is constant: quick at first
        return np.asarray((1.0 - np.exp(-1.6 * share)) / (1.0 - np.exp(-1.6)))
    if way == "coast":  # air holds more at first
        return np.asarray(share * (1.35 - 0.35 * share))
    return share


def procedures(rng: np.random.Generator, scenario: str, n: int, dt: float) -> Array:
    """Speed that the procedure asks for, (n,) m/s."""
    procedure, low = PROCEDURES[scenario]
    pieces: list[Array] = []
    runs = procedure(rng)
    at, skipped, length = runs[0][0], rng.uniform(0.0, 40.0), 0
    while length < n + round(skipped / dt):
        for to, seconds, way in runs:
            share = (np.arange(max(1, round(seconds / dt))) + 1.0) / max(1, round(seconds / dt))
            pieces.append(at + (to - at) * _shape(way, share))
            at, length = to, length + len(share)
        runs = procedure(rng)
    return finish(rng, np.concatenate(pieces)[round(skipped / dt) :][:n], dt, 0.15, 9.0, low)
