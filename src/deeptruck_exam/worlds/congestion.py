"""Speeds in dense traffic: waves of slowing come towards the driver, who then gathers speed again."""

from __future__ import annotations

import numpy as np

from deeptruck_exam.effects.law import Array
from deeptruck_exam.worlds.traffic import FLOOR, KINDS, Kind, allowed, finish


def waves_back(rng: np.random.Generator, scenario: str, n: int, dt: float) -> Array:
    """Slowings by waves or lights, each steep on its way down, then an approach to the free speed that gets
    slower (Kerner, The Physics of Traffic, 2004, on jams that move upstream)."""
    kind, floor = KINDS[scenario], FLOOR.get(scenario, 0.0)
    free = allowed(rng, kind)
    pieces, length, speed = [np.full(round(rng.uniform(2.0, 20.0) / dt), free)], 0, free
    while length < n:
        free = allowed(rng, kind) if rng.random() < 0.5 else free
        goal = 0.0 if rng.random() < kind.stops else max(free * rng.uniform(0.45, 0.88), floor)
        pieces.append(_slows(rng, kind, speed, min(goal, speed), dt))
        pieces.append(_gathers(rng, kind, min(goal, speed), free, dt))
        speed = float(pieces[-1][-1])
        length = sum(len(piece) for piece in pieces)
    return finish(rng, np.concatenate(pieces)[:n], dt, 0.25, 12.0, floor)


def _slows(rng: np.random.Generator, kind: Kind, speed: float, goal: float, dt: float) -> Array:
    """Down to the goal, sharper in the middle, and some seconds in it."""
    m = max(2, round(1.5 * (speed - goal) / rng.uniform(*kind.slow) / dt))
    share = (np.arange(m) + 1.0) / m
    down = speed + (goal - speed) * share**2 * (3.0 - 2.0 * share)
    stays = rng.uniform(2.0, 12.0) if goal == 0.0 else rng.uniform(1.0, 7.0)
    return np.concatenate([down, np.full(round(stays / dt), goal)])


def _gathers(rng: np.random.Generator, kind: Kind, speed: float, free: float, dt: float) -> Array:
    """Towards the free speed, and along with it until the next wave."""
    pull, seconds = rng.uniform(*kind.pull), 8.0 + rng.gamma(1.5, 0.7 * kind.lasts_s)
    slows_s = max(abs(free - speed), 0.5) / (1.5 * pull)
    time = (np.arange(round(seconds / dt)) + 1.0) * dt
    return np.asarray(free - (free - speed) * np.exp(-time / slows_s))
