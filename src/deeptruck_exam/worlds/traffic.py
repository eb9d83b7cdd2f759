"""Speeds that traffic, signs, procedures and bends leave a driver: one way to make them for each world.

Each takes a generator, the kind of drive, samples and dt, and returns the speed (n,) in m/s.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from deeptruck_exam.effects.law import Array
from deeptruck_exam.effects.series import ou_series

SpeedProfile = Callable[[np.random.Generator, str, int, float], Array]
FLOOR = {"highway": 14.2}  # m/s; nobody is slower there
Range = tuple[float, float]


@dataclass(frozen=True)
class Kind:
    """A kind of drive: speeds m/s with weights, how long one lasts (s) and how far it goes (m); share of
    stops; pulling, slowing m/s2; what is passed on the way: its speed m/s and length m; distance m between
    lights (0: none); how much slower leaders are at most, m/s."""

    speeds: tuple[float, ...]
    weights: tuple[float, ...]
    lasts_s: float
    stretch_m: float
    stops: float
    pull: Range
    slow: Range
    pass_mps: Range
    pass_m: Range
    lights_m: float
    slower: float


KINDS = {
    "highway": Kind(
        (17.0, 22.0, 23.8, 25.0), (0.15, 0.3, 0.35, 0.2), 38.0, 1300.0, 0.0,
        (0.2, 0.5), (0.25, 0.8), (15.0, 19.5), (60.0, 500.0), 0.0, 6.0,
    ),
    "suburban": Kind(
        (8.5, 11.0, 13.8, 16.0), (0.3, 0.2, 0.35, 0.15), 16.0, 260.0, 0.45,
        (0.45, 0.9), (0.7, 1.5), (3.5, 7.5), (20.0, 70.0), 330.0, 8.0,
    ),
    "hills": Kind(
        (12.8, 15.8, 18.5, 21.0), (0.2, 0.3, 0.3, 0.2), 30.0, 550.0, 0.05,
        (0.3, 0.7), (0.4, 1.1), (8.0, 14.0), (40.0, 220.0), 2600.0, 6.0,
    ),
    "descent": Kind(
        (9.0, 12.0, 14.5, 16.8), (0.2, 0.3, 0.3, 0.2), 30.0, 330.0, 0.03,
        (0.25, 0.6), (0.45, 1.2), (7.0, 11.0), (40.0, 150.0), 0.0, 4.0,
    ),
}  # fmt: skip


def finish(
    rng: np.random.Generator, speed: Array, dt: float, wander: float, seconds: float, floor: float
) -> Array:
    """The speed with a slow wander and no corners."""
    n = len(speed)
    smooth = np.convolve(ou_series(rng, (1, n), dt, seconds)[0], np.hanning(61) / 30.0, mode="same")
    speed = speed + wander * smooth * np.clip(speed / 7.0 - 0.4, 0.0, 1.0)
    ease = np.hanning(15) / np.hanning(15).sum()
    return np.asarray(np.clip(np.convolve(np.pad(speed, 7, mode="edge"), ease, mode="valid"), floor, 27.5))


def allowed(rng: np.random.Generator, kind: Kind) -> float:
    return float(rng.choice(kind.speeds, p=kind.weights)) * rng.normal(0.99, 0.02)


def holds(rng: np.random.Generator, scenario: str, n: int, dt: float, ramp: str = "line") -> Array:
    """Speeds that are held for a while, joined by lines or half waves of a cosine."""
    kind = KINDS[scenario]
    speed, out, length = allowed(rng, kind), [np.empty(0)], 0
    while length < n:
        stop = speed > 0.0 and rng.random() < kind.stops
        new = 0.0 if stop else allowed(rng, kind)
        m = max(
            2, round(1.3 * abs(new - speed) / rng.uniform(*(kind.pull if new > speed else kind.slow)) / dt)
        )
        share = np.arange(m) / m
        share = share if ramp == "line" else 0.5 * (1.0 - np.cos(np.pi * share))
        hold = rng.uniform(2.0, 9.0) if stop else 4.0 + rng.exponential(kind.lasts_s)
        out += [speed + (new - speed) * share, np.full(round(hold / dt), new)]
        speed, length = new, length + len(out[-1]) + len(out[-2])
    floor = FLOOR.get(scenario, 0.0)
    return finish(rng, np.concatenate(out)[:n], dt, 0.4, 10.0, floor)


def smooth_holds(rng: np.random.Generator, scenario: str, n: int, dt: float) -> Array:
    """`holds` joined by half waves."""
    return holds(rng, scenario, n, dt, "cosine")


def zones(rng: np.random.Generator, scenario: str, n: int, dt: float) -> Array:
    """Zones of a limit each: up as engines do, ever weaker towards the limit; down first by letting roll,
    then by braking; queues that creep from stop to stop; snubs downhill."""
    kind = KINDS[scenario]
    plan = _zones(rng, kind, n * dt)
    out, (speed, left), zone = np.empty(n), plan[0], 0
    up, down = rng.uniform(*kind.pull), rng.uniform(*kind.slow)
    eases_s, rolls, since = rng.uniform(0.0, 6.0), rng.uniform(0.06, 0.16), 0.0
    for k in range(n):
        goal = plan[zone][0]
        since = 0.0 if speed <= goal else since + dt
        if speed > goal + 0.02:
            speed = max(speed - dt * (rolls if since < eases_s and goal > 0.0 else down), goal)
        else:
            rise = min(up * (1.05 - (speed / max(goal, 0.3)) ** 2), up)
            speed, left = min(speed + dt * rise, goal), left - dt
        if left <= 0.0 and zone + 1 < len(plan):
            zone, left = zone + 1, plan[zone + 1][1]
            up, down = rng.uniform(*kind.pull), rng.uniform(*kind.slow)
        out[k] = speed
    if scenario == "descent" and rng.random() < 0.6:
        out = _snubbed(rng, out, dt)
    return finish(rng, out, dt, 0.3, 18.0, FLOOR.get(scenario, 0.0))


def _zones(rng: np.random.Generator, kind: Kind, seconds: float) -> list[tuple[float, float]]:
    """Speeds m/s and their lengths s; a stop is one of speed 0."""
    out: list[tuple[float, float]] = []
    while sum(length for _, length in out) < seconds + 60.0:
        out.append((allowed(rng, kind), 6.0 + rng.gamma(2.0, 0.5 * kind.lasts_s)))
        if rng.random() < kind.stops:
            out.append((0.0, rng.uniform(2.0, 14.0)))
            for _ in range(rng.geometric(0.7) - 1):
                out += [(rng.uniform(1.5, 4.5), rng.uniform(4.0, 9.0)), (0.0, rng.uniform(1.5, 6.0))]
    return out


def _snubbed(rng: np.random.Generator, speed: Array, dt: float) -> Array:
    """Snub braking (commercial driver's handbooks): let the truck run up to the safe speed, brake 8 km/h
    off it, release; a saw tooth below the speed."""
    rise, fall, depth = rng.uniform(0.10, 0.25), rng.uniform(0.6, 1.0), rng.uniform(1.4, 2.6)
    period = depth / rise + depth / fall
    phase = (np.arange(len(speed)) * dt + rng.uniform(0.0, period)) % period
    tooth = np.where(phase < depth / fall, fall * phase, depth - rise * (phase - depth / fall))
    return np.asarray(speed - tooth * np.clip(speed / 6.0 - 0.7, 0.0, 1.0))


CELL_M = 2.0


def planned(rng: np.random.Generator, scenario: str, n: int, dt: float) -> Array:
    """Planned along the way between tolls, roundabouts, exits and bends: backwards by braking, forwards by
    pull and power."""
    kind = KINDS[scenario]
    limit, waits = _limits(rng, kind, 30.0 * n * dt)
    pull, power, brake = rng.uniform(*kind.pull), rng.uniform(4.0, 9.0), rng.uniform(*kind.slow)
    for k in range(len(limit) - 2, -1, -1):
        limit[k] = min(limit[k], np.sqrt(limit[k + 1] ** 2 + 2.0 * brake * CELL_M))
    for k in range(1, len(limit)):
        most = min(pull, power / max(limit[k - 1], 1.0))
        limit[k] = min(limit[k], np.sqrt(limit[k - 1] ** 2 + 2.0 * most * CELL_M))
    mean = np.maximum(0.5 * (limit[1:] + limit[:-1]), 0.25)
    clock = np.concatenate([[0.0], np.cumsum(CELL_M / mean + waits[:-1])])[:-1]
    times = np.stack([clock, clock + waits[:-1]], axis=1).ravel()  # a stop is a place with two times
    speed = np.interp(np.arange(n) * dt, times, np.repeat(limit[:-1], 2))
    return finish(rng, speed, dt, 0.2, 14.0, FLOOR.get(scenario, 0.0))


def _limits(rng: np.random.Generator, kind: Kind, metres: float) -> tuple[Array, Array]:
    """Speed (cells,) that each place allows, and seconds (cells,) that are waited there."""
    n = round(metres / CELL_M) + 1
    limit, waits, at = np.empty(n), np.zeros(n), 0
    while at < n:
        end = at + round((40.0 + rng.gamma(2.0, kind.stretch_m / 2.0)) / CELL_M)
        limit[at:end] = min(allowed(rng, kind), 27.0)
        at = end + max(1, round(rng.uniform(*kind.pass_m) / CELL_M))
        limit[end:at] = rng.uniform(*kind.pass_mps)
        if rng.random() < kind.stops and end < n:
            limit[end], waits[end] = 0.0, 2.0 + rng.gamma(2.0, 3.0)
    return limit, waits
