"""Roads across rows of sand ridges and down a valley that slides have dammed, and speeds between cameras."""

from __future__ import annotations

import numpy as np

from deeptruck_exam.effects.law import Array
from deeptruck_exam.worlds.roads import CELLS, STEEPEST, STEP_M
from deeptruck_exam.worlds.traffic import FLOOR, KINDS, Kind, allowed, finish

RIDGE_M = 560.0  # usual way from crest to crest
SECTION_M = {
    "highway": (1200.0, 3200.0),
    "suburban": (220.0, 600.0),
    "hills": (600.0, 1800.0),
    "descent": (350.0, 1100.0),
}
AFTER_M = 0.5  # of a section's usual length, from its end to the next one
SHUT = 0.5  # of gates in town, at which one waits
EASES_S = (2.0, 4.5)  # time constant of a driver who comes to a speed


def sand_ridges(rng: np.random.Generator, amplitude: float) -> Array:
    """Across a field of long ridges of sand, one behind the other: nearly level floors, flanks that get ever
    steeper up to a narrow crest, which the road rounds, and one side of all ridges steeper than the other.
    (Lancaster, Geomorphology of Desert Dunes, 1995, on linear dunes and their plinths; lengths are chosen
    here.)"""
    slope, at = np.zeros(CELLS + 400), -round(rng.uniform(0.0, RIDGE_M) / STEP_M)
    lee = rng.uniform(1.05, 1.5) ** rng.choice([-1.0, 1.0])
    while at < CELLS:
        whole = max(RIDGE_M * rng.lognormal(0.0, 0.35), 220.0)
        high = rng.uniform(0.7, 1.25)
        up, down = (max(round(0.36 * whole * side / STEP_M), 5) for side in (lee**0.5, lee**-0.5))
        floor = max(round(rng.uniform(0.16, 0.4) * whole / STEP_M), 2)
        rises = high * ((np.arange(up) + 0.5) / up) ** 1.6
        falls = -high * up / down * ((np.arange(down)[::-1] + 0.5) / down) ** 1.6
        for part in (np.zeros(floor), rises, falls):
            low, top = max(at, 0), max(at + len(part), 0)
            slope[low:top] = part[len(part) - (top - low) :]
            at += len(part)
    ease = np.hanning(15) / np.hanning(15).sum()
    along = np.convolve(slope[:CELLS], ease, mode="same")
    return np.clip(amplitude * along / along.std(), -STEEPEST, STEEPEST)


def dammed_down(rng: np.random.Generator) -> Array:
    """Down a valley that slides have dammed many times: an easy way over the floor of each lake that was, and
    then ever steeper over the front of its dam, to the next floor. (Korup, Rock-Slope Failure and the River
    Long Profile, Geology 34, 2006; lengths are chosen here.)"""
    grade, at = np.empty(CELLS + 400), 0
    while at < CELLS:
        floor, front = round(rng.uniform(70.0, 260.0) / STEP_M), round(rng.uniform(400.0, 1300.0) / STEP_M)
        steep = rng.uniform(0.066, 0.074)
        grade[at : at + floor] = -rng.uniform(0.014, 0.022)
        share = (np.arange(front) + 0.5) / front
        grade[at + floor : at + floor + front] = -(0.03 + (steep - 0.03) * share**0.8)
        at += floor + front
    ease = np.hanning(7) / np.hanning(7).sum()
    return np.clip(np.convolve(grade[:CELLS], ease, mode="same"), -STEEPEST, -0.012)


def _section(
    rng: np.random.Generator, scenario: str, kind: Kind, after: float, floor: float
) -> tuple[float, float, float, float]:
    """Start and end m of a section between two cameras, the speed that the grid or gate at its end is passed
    at, and s that are waited there."""
    least, most = SECTION_M[scenario]
    start = after + AFTER_M * rng.uniform(least, most)
    waits = 5.0 + rng.gamma(2.0, 7.0) if scenario == "suburban" and rng.random() < SHUT else 0.0
    past = 0.0 if waits > 0.0 else max(float(rng.uniform(*kind.pass_mps)), floor + 0.3)
    return start, start + rng.uniform(least, most), past, waits


def _hurries(way: float, clock: float, usual: float, long: float, bold: float) -> float:
    """The speed in a section: bold at first; then what its mean leaves, as far as one is sure of it."""
    done = way / max(long, 1.0)
    owed = max(long * 0.98 / usual - clock, 1.0)
    left = max(long - way, 1.0) / owed
    sure = float(np.clip(2.5 * (done - 0.35), 0.0, 1.0))
    return float(np.clip((1.0 - sure) * bold * usual + sure * left, 0.75 * usual, 1.09 * usual))


def cameras(rng: np.random.Generator, scenario: str, n: int, dt: float) -> Array:
    """Two cameras reckon the mean speed between them: one hurries after the first and pays it back before the
    second. Behind it lies a grid against cattle, passed slowly, or in town a gate that may be shut. (Soole,
    Watson and Fleiter, Effects of Average Speed Enforcement, Accident Analysis and Prevention 54, 2013, on
    how speeds are spread over a section; numbers are chosen here.)"""
    kind, floor = KINDS[scenario], FLOOR.get(scenario, 0.0)
    usual, bold, eases = allowed(rng, kind), rng.uniform(1.02, 1.09), rng.uniform(*EASES_S)
    up, down = rng.uniform(*kind.pull), rng.uniform(*kind.slow)
    out, speed, way, clock = np.empty(n), usual, 0.0, 0.0
    start, end, past, waits = _section(rng, scenario, kind, 0.0, floor)
    for k in range(n):
        limit = np.sqrt(past**2 + 2.0 * down * max(end - way, 0.0))
        if end - way < 0.4 and past == 0.0:
            speed, waits = max(speed - 1.25 * down * dt, 0.0), waits - dt
        else:
            inside = way >= start
            clock = clock + dt if inside else 0.0
            goal = _hurries(way - start, clock, usual, end - start, bold) if inside else usual
            pulls = float(np.clip((goal - speed) / eases, -down, up))
            speed = min(speed + dt * pulls, max(speed - 1.25 * down * dt, float(limit)))
            way += dt * max(speed, 0.3)
        speed = float(np.clip(speed, floor, 27.0))
        if way >= end or waits < 0.0:
            way = max(way, end)
            start, end, past, waits = _section(rng, scenario, kind, end, floor)
            usual, bold, eases = allowed(rng, kind), rng.uniform(1.02, 1.09), rng.uniform(*EASES_S)
            up, down = rng.uniform(*kind.pull), rng.uniform(*kind.slow)
        out[k] = speed
    return finish(rng, out, dt, 0.25, 8.0, floor)
