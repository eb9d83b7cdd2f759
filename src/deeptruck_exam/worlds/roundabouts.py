"""Speeds between roundabouts: every kilometre or less one gives way, and between them gathers speed again."""

from __future__ import annotations

import numpy as np

from deeptruck_exam.effects.law import Array
from deeptruck_exam.worlds.traffic import FLOOR, KINDS, Kind, allowed, finish

APART_M = {"highway": 1500.0, "suburban": 300.0, "hills": 800.0, "descent": 450.0}
THROUGH_MPS = {"highway": (14.5, 20.0), "suburban": (4.5, 7.0), "hills": (6.0, 9.5), "descent": (5.5, 8.5)}
GIVES_WAY = {"highway": 0.0, "suburban": 0.4, "hills": 0.05, "descent": 0.0}


def roundabouts(rng: np.random.Generator, scenario: str, n: int, dt: float) -> Array:
    """From one roundabout to the next: pull that fades towards the wished speed (Treiber, Hennecke and
    Helbing, Congested Traffic States in Empirical Observations and Microscopic Simulations, Phys. Rev. E 62,
    2000), then an even braking to the speed of the circle; distances and speeds are chosen here."""
    kind, floor = KINDS[scenario], FLOOR.get(scenario, 0.0)
    wished = allowed(rng, kind)
    out, speed = [np.full(round(rng.uniform(1.0, 15.0) / dt), wished)], wished
    while sum(len(piece) for piece in out) < n:
        wished = allowed(rng, kind) if rng.random() < 0.6 else wished
        stops = rng.random() < GIVES_WAY[scenario]
        through = 0.0 if stops else min(rng.uniform(*THROUGH_MPS[scenario]), 0.95 * wished)
        out.append(_leg(rng, kind, (speed, wished, through), 0.3 + rng.gamma(3.0, 0.23), scenario, dt))
        waits = rng.gamma(2.0, 2.5) + 1.5 if stops else rng.uniform(1.5, 5.0)
        out.append(np.full(round(waits / dt), through))
        speed = through
    return finish(rng, np.concatenate(out)[:n], dt, 0.3, 9.0, floor)


def _leg(
    rng: np.random.Generator,
    kind: Kind,
    speeds: tuple[float, float, float],
    long: float,
    scenario: str,
    dt: float,
) -> Array:
    """Speed from one circle to the next, `long` times the usual distance away."""
    speed, wished, through = speeds
    pull, slow = 1.3 * rng.uniform(*kind.pull), rng.uniform(*kind.slow)
    power, left, out = rng.uniform(1.5, 4.0), long * APART_M[scenario], []
    while left > max(speed**2 - through**2, 0.0) / (2.0 * slow):
        speed = max(speed + dt * pull * (1.0 - (speed / wished) ** power), 0.3)
        left -= dt * speed
        out.append(speed)
    while speed > through:
        speed = max(speed - dt * slow, through)
        out.append(speed)
    return np.array(out)
