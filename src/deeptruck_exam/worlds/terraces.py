"""Roads over the terraces of a river and down a stair of hard beds, and speeds between roadworks."""

from __future__ import annotations

import numpy as np

from deeptruck_exam.effects.law import Array
from deeptruck_exam.worlds.roads import CELLS, STEEPEST, STEP_M
from deeptruck_exam.worlds.traffic import FLOOR, KINDS, Kind, allowed, finish

TREAD_M = 260.0  # usual way over one terrace
WORKS_M = {
    "highway": (1400.0, 3600.0),
    "suburban": (200.0, 650.0),
    "hills": (600.0, 1800.0),
    "descent": (300.0, 1000.0),
}
HELD = 0.5  # of roadworks in town, where one is held by a flag
EASES_S = (2.5, 5.5)  # time constant of a driver who comes up to a speed


def terraces(rng: np.random.Generator, amplitude: float) -> Array:
    """Stairs of a river's old floors: nearly level treads, and risers between them that are steepest in their
    middle, several up to the height between two valleys and as many down. (Bridgland and Westaway,
    Climatically Controlled River Terrace Staircases, Geomorphology 98, 2008; lengths are chosen here.)"""
    slope, at, sign = np.zeros(CELLS + 400), -round(rng.uniform(0.0, 900.0) / STEP_M), rng.choice([-1.0, 1.0])
    left = int(rng.integers(2, 6))
    while at < CELLS:
        tread = max(round(TREAD_M * rng.lognormal(0.0, 0.5) / STEP_M), 4)
        riser = max(round(rng.uniform(90.0, 320.0) / STEP_M), 8)
        lobe = np.sin(np.pi * (np.arange(riser) + 0.5) / riser) ** 2
        leans = np.full(tread, 0.05 * sign)
        for part in (leans, sign * rng.uniform(0.8, 1.2) * lobe):
            low, high = max(at, 0), max(at + len(part), 0)
            slope[low:high] = part[len(part) - (high - low) :]
            at += len(part)
        left -= 1
        if left == 0:
            sign, left = -sign, int(rng.integers(2, 6))
    along = slope[:CELLS]
    return np.clip(amplitude * along / along.std(), -STEEPEST, STEEPEST)


def stair_down(rng: np.random.Generator) -> Array:
    """Down a stair of hard and soft beds, each of the same thickness over the whole way: steep over the hard
    ones, easy over the soft ones, and by the same height each time. (Selby, Hillslope Materials and
    Processes, 1993, on slopes by the strength of beds; heights are chosen here.)"""
    grade, at = np.empty(CELLS + 400), 0
    hard_m, soft_m = rng.uniform(14.0, 30.0), rng.uniform(3.5, 8.0)
    while at < CELLS:
        for high, steep in ((hard_m, rng.uniform(0.052, 0.072)), (soft_m, rng.uniform(0.013, 0.024))):
            cells = max(round(high / steep / STEP_M), 4)
            grade[at : at + cells] = -steep
            at += cells
    ease = np.hanning(9) / np.hanning(9).sum()
    return np.clip(np.convolve(grade[:CELLS], ease, mode="same"), -STEEPEST, -0.012)


def _next(
    rng: np.random.Generator, scenario: str, kind: Kind, after: float, floor: float
) -> tuple[float, float, float, float]:
    """Start and end m of roadworks, the speed that they are passed at, and s that are waited before."""
    start = after + rng.uniform(*WORKS_M[scenario])
    long = rng.uniform(*kind.pass_m) * rng.uniform(1.0, 3.0)
    waits = 6.0 + rng.gamma(2.0, 7.0) if scenario == "suburban" and rng.random() < HELD else 0.0
    return start, start + long, max(float(rng.uniform(*kind.pass_mps)), floor + 0.3), waits


def _moved(speed: float, goal: float, eases_s: float, up: float, down: float, dt: float) -> float:
    """The speed a step nearer to the goal, never harder than by up and down m/s2."""
    return speed + dt * float(np.clip((goal - speed) / eases_s, -down, up))


def works(rng: np.random.Generator, scenario: str, n: int, dt: float) -> Array:
    """Roadworks of one lane: one is held by a flag, in town, and passes behind a pilot at his speed; between
    them everybody comes up to the speed that he likes ever more slowly. (Federal Highway Administration,
    Manual on Uniform Traffic Control Devices, 2009, part 6 on flaggers and pilot cars; numbers are chosen
    here.)"""
    kind, floor = KINDS[scenario], FLOOR.get(scenario, 0.0)
    usual, eases = allowed(rng, kind), rng.uniform(*EASES_S)
    up, down = rng.uniform(*kind.pull), rng.uniform(*kind.slow)
    out, speed, way, left = np.empty(n), usual, 0.0, 6.0 + rng.exponential(kind.lasts_s)
    start, end, past, waits = _next(rng, scenario, kind, 0.0, floor)
    for k in range(n):
        ahead = 0.0 if waits > 0.0 else past
        limit = np.sqrt(ahead**2 + 2.0 * down * max(start - way, 0.0))
        if way >= start - 0.4 and waits > 0.0:
            speed, waits, way = max(speed - 1.25 * down * dt, 0.0), waits - dt, max(way, start - 0.4)
        else:
            goal = min(usual, past if way >= start else np.inf)
            speed = min(_moved(speed, goal, eases, up, down, dt), max(speed - 1.25 * down * dt, float(limit)))
            speed = max(speed, 0.4) if way >= start - 0.4 else speed
        speed = float(np.clip(speed, floor, 27.0))
        way, left = way + (speed * dt if waits <= 0.0 or way < start - 0.4 else 0.0), left - dt
        if way >= end:
            start, end, past, waits = _next(rng, scenario, kind, end, floor)
            up, down = rng.uniform(*kind.pull), rng.uniform(*kind.slow)
        if left <= 0.0:
            usual, eases = allowed(rng, kind), rng.uniform(*EASES_S)
            left = 6.0 + rng.exponential(kind.lasts_s)
        out[k] = speed
    return finish(rng, out, dt, 0.2, 7.0, floor)
