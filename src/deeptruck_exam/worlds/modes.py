"""Speeds as a chain of modes: standing, pulling, keeping, easing, slowing and creeping follow by chance."""

from __future__ import annotations

import numpy as np

from deeptruck_exam.effects.law import Array
from deeptruck_exam.worlds.traffic import FLOOR, KINDS, Kind, allowed, finish

NEXT = {  # what follows a mode, and how often
    "stand": (("pull", 0.75), ("creep", 0.25)),
    "creep": (("stand", 0.55), ("pull", 0.45)),
    "pull": (("keep", 0.7), ("ease", 0.2), ("slow", 0.1)),
    "keep": (("ease", 0.3), ("slow", 0.4), ("pull", 0.3)),
    "ease": (("keep", 0.4), ("slow", 0.3), ("pull", 0.3)),
    "slow": (("keep", 0.35), ("pull", 0.65)),
}


def modes(rng: np.random.Generator, scenario: str, n: int, dt: float) -> Array:
    """Lin and Niemeier, An Exploratory Analysis Comparing a Stochastic Driving Cycle to California's
    Regulatory Cycle, Atmospheric Environment 36 (2002): a Markov chain of modes; its chances are chosen
    here."""
    kind, floor = KINDS[scenario], FLOOR.get(scenario, 0.0)
    speed, mode = allowed(rng, kind), "keep"
    pieces, length = [], 0
    while length < n:
        pieces.append(_piece(rng, kind, mode, speed, floor, dt))
        speed, length = float(pieces[-1][-1]), length + len(pieces[-1])
        mode = _follows(rng, kind, mode, speed)
    return finish(rng, np.concatenate(pieces)[:n], dt, 0.3, 7.0, floor)


def _follows(rng: np.random.Generator, kind: Kind, mode: str, speed: float) -> str:
    """The next mode; who has slowed to nothing stands."""
    if mode == "slow" and speed < 0.1:
        return "stand"
    names, chances = zip(*NEXT[mode], strict=True)
    return str(rng.choice(names, p=chances))


def _piece(rng: np.random.Generator, kind: Kind, mode: str, speed: float, floor: float, dt: float) -> Array:
    """Speeds of one mode, from the last one on."""
    if mode == "stand":
        return np.full(round((2.0 + rng.gamma(2.0, 4.0)) / dt), speed)
    if mode == "keep":
        return np.full(round((3.0 + rng.exponential(0.6 * kind.lasts_s)) / dt), speed)
    if mode == "creep":
        along = np.linspace(0.0, 1.0, round(rng.uniform(6.0, 12.0) / dt))
        return np.asarray(rng.uniform(1.5, 4.0) * np.sin(np.pi * along) ** 2)
    return _changes(rng, kind, mode, speed, _goal(rng, kind, mode, speed, floor), dt)


def _changes(rng: np.random.Generator, kind: Kind, mode: str, speed: float, goal: float, dt: float) -> Array:
    """From a speed to the goal, as the mode does it."""
    rate = {"pull": kind.pull, "ease": (0.08, 0.22), "slow": kind.slow}[mode]
    m = max(5, round(1.4 * abs(goal - speed) / rng.uniform(*rate) / dt))
    share = (np.arange(m) + 1.0) / m
    bent = {"ease": share, "pull": np.sin(0.5 * np.pi * share), "slow": 0.5 * (share + share**2)}[mode]
    return np.asarray(speed + (goal - speed) * bent)


def _goal(rng: np.random.Generator, kind: Kind, mode: str, speed: float, floor: float) -> float:
    """Speed at the end of a mode that changes it."""
    if mode == "pull":
        return max(allowed(rng, kind), speed)
    if mode == "slow" and rng.random() < kind.stops:
        return 0.0
    low = 0.82 if mode == "ease" else 0.5
    return max(speed * rng.uniform(low, 0.95), min(floor, speed), 0.4 * kind.speeds[0])
