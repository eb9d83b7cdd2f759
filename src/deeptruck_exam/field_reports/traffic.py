"""Speeds of the fourth world: limits by zones, easing off before a lower one, queues, snubbing downhill."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from deeptruck_exam.hidden import Array, ou_series

KMH = 1.0 / 3.6


@dataclass(frozen=True)
class Zones:
    """limits km/h with their weights; mean length s; chance of a stop at the end; strength m/s2."""

    limits: tuple[float, ...]
    weights: tuple[float, ...]
    mean_s: float
    stops: float
    up: tuple[float, float]
    down: tuple[float, float]


ZONES = {
    "highway": Zones((60.0, 80.0, 85.0, 90.0), (0.15, 0.35, 0.25, 0.25), 38.0, 0.0, (0.2, 0.45), (0.25, 0.7)),
    "suburban": Zones((30.0, 40.0, 50.0, 60.0), (0.3, 0.2, 0.35, 0.15), 18.0, 0.5, (0.45, 0.85), (0.7, 1.4)),
    "hills": Zones((45.0, 55.0, 65.0, 75.0), (0.2, 0.25, 0.3, 0.25), 30.0, 0.05, (0.3, 0.7), (0.4, 1.0)),
    "descent": Zones((35.0, 45.0, 55.0, 62.0), (0.2, 0.3, 0.3, 0.2), 35.0, 0.02, (0.25, 0.5), (0.5, 1.2)),
}


def _zones(rng: np.random.Generator, kind: Zones, seconds: float) -> list[tuple[float, float]]:
    """Speeds m/s and their lengths s; a stop is one of speed 0, and queues creep from stop to stop."""
    bias = rng.normal(0.99, 0.025)  # of this driver against the limit
    out: list[tuple[float, float]] = []
    while sum(length for _, length in out) < seconds + 60.0:
        limit = float(rng.choice(kind.limits, p=kind.weights)) * KMH * bias
        out.append((limit, 6.0 + rng.gamma(2.0, 0.5 * kind.mean_s)))
        if rng.random() < kind.stops:
            out.append((0.0, rng.uniform(2.0, 14.0)))
            for _ in range(rng.geometric(0.7) - 1):
                out += [(rng.uniform(1.5, 4.5), rng.uniform(4.0, 9.0)), (0.0, rng.uniform(1.5, 6.0))]
    return out


def _follow(
    rng: np.random.Generator, kind: Zones, plan: list[tuple[float, float]], n: int, dt: float
) -> Array:
    """Speed (n,) along the plan: up as engines do, ever weaker towards the limit; down first by letting
    roll, then by braking."""
    out, speed, zone, left = np.empty(n), plan[0][0], 0, plan[0][1]
    up, down = rng.uniform(*kind.up), rng.uniform(*kind.down)
    eases_s, rolls = rng.uniform(0.0, 6.0), rng.uniform(0.06, 0.16)
    since = 0.0
    for k in range(n):
        goal = plan[zone][0]
        since = 0.0 if speed <= goal else since + dt
        if speed > goal + 0.02:
            speed = max(speed - dt * (rolls if since < eases_s and goal > 0.0 else down), goal)
        else:
            speed += dt * min(up * (1.05 - (speed / max(goal, 0.3)) ** 2), up) if goal > 0.0 else 0.0
            speed = min(speed, goal)
            left -= dt
        if left <= 0.0 and zone + 1 < len(plan):
            zone, left = zone + 1, plan[zone + 1][1]
            up, down = rng.uniform(*kind.up), rng.uniform(*kind.down)
        out[k] = speed
    return out


def _snub(rng: np.random.Generator, speed: Array, dt: float) -> Array:
    """Snub braking (commercial driver's handbooks): let the truck run up to the safe speed, brake 8 km/h
    off it, release; a saw tooth below the speed."""
    rise, fall, depth = rng.uniform(0.10, 0.25), rng.uniform(0.6, 1.0), rng.uniform(1.4, 2.6)
    period = depth / rise + depth / fall
    phase = (np.arange(len(speed)) * dt + rng.uniform(0.0, period)) % period
    tooth = np.where(phase < depth / fall, fall * phase, depth - rise * (phase - depth / fall))
    return speed - tooth * np.clip(speed / 6.0 - 0.7, 0.0, 1.0)


def speed_profile(rng: np.random.Generator, scenario: str, n: int, dt: float) -> Array:
    """Speed a driver has in mind, (n,) m/s."""
    kind = ZONES[scenario]
    speed = _follow(rng, kind, _zones(rng, kind, n * dt), n, dt)
    if scenario == "descent" and rng.random() < 0.6:
        speed = _snub(rng, speed, dt)
    wander = np.convolve(ou_series(rng, (1, n), dt, 18.0)[0], np.hanning(51) / 25.0, mode="same")
    speed = speed + 0.3 * wander * np.clip(speed / 8.0 - 0.2, 0.0, 1.0)
    ease = np.hanning(13) / np.hanning(13).sum()
    padded = np.concatenate([np.full(6, speed[0]), speed, np.full(6, speed[-1])])
    return np.asarray(np.maximum(np.convolve(padded, ease, mode="valid"), 0.0))
