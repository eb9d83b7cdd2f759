"""Roads over round hills of loess and down its gullies, and speeds in convoys."""

from __future__ import annotations

import numpy as np

from deeptruck_exam.effects.law import Array
from deeptruck_exam.worlds.roads import CELLS, STEEPEST, STEP_M
from deeptruck_exam.worlds.traffic import FLOOR, KINDS, allowed, finish

LOOKS = {"highway": (1, 3), "suburban": (1, 3), "hills": (1, 4), "descent": (1, 3)}  # trucks ahead
GAP_M = 7.0  # at a stand, without the truck's length


def _smooth(slope: Array, cells: int) -> Array:
    ease = np.hanning(cells) / np.hanning(cells).sum()
    return np.asarray(np.convolve(slope, ease, mode="same"))


def round_hills(rng: np.random.Generator, amplitude: float) -> Array:
    """Over hills as round as loaves, steepest at their feet, where gullies part them; between some of them a
    flat top. (Derbyshire, Geological Hazards in Loess Terrain, Earth-Science Reviews 54, 2001, on hills that
    are called mao and tables that are called yuan; lengths are chosen here.)"""
    slope, at = np.zeros(CELLS + 900), -round(rng.uniform(0.0, 500.0) / STEP_M)
    while at < CELLS:
        cells = max(round(500.0 * rng.lognormal(0.0, 0.4) / STEP_M), 16)
        loaf = np.sign(np.linspace(1.0, -1.0, cells)) * np.abs(np.linspace(1.0, -1.0, cells)) ** rng.uniform(
            0.7, 1.4
        )
        first, last = max(at, 0), max(at + cells, 0)
        slope[first:last] = (rng.uniform(0.6, 1.3) * loaf)[first - at : last - at]
        at += cells
        if rng.random() < 0.3:
            at += round(rng.uniform(150.0, 700.0) / STEP_M)
    along = _smooth(slope[:CELLS], 9)
    limit = 2.2 * amplitude
    return np.clip(limit * np.tanh(amplitude * along / along.std() / limit), -STEEPEST, STEEPEST)


def gullies_down(rng: np.random.Generator) -> Array:
    """Down a gully that flattens with a power of the way from its head, as the brook in it grows; over the
    sill of a dam into another one now and then. (Flint, Stream Gradient as a Function of Order, Magnitude,
    and Discharge, Water Resources Research 10, 1974; lengths are chosen here.)"""
    grade, at = np.empty(CELLS + 300), 0
    while at < CELLS:
        cells = round((400.0 + rng.exponential(700.0)) / STEP_M)
        cells = min(cells, 300)
        way = (np.arange(cells) + rng.uniform(3.0, 8.0)) * STEP_M
        grade[at : at + cells] = -np.clip(0.068 * (way / 60.0) ** -rng.uniform(0.1, 0.22), 0.03, 0.072)
        sill = min(round(rng.uniform(30.0, 90.0) / STEP_M), cells)
        grade[at + cells - sill : at + cells] = -rng.uniform(0.014, 0.024)
        at += cells
    return np.clip(_smooth(grade[:CELLS], 9), -STEEPEST, -0.012)


def _first_of_them(rng: np.random.Generator, scenario: str, n: int, dt: float) -> Array:
    """Speed (n,) of the convoy's head: signs, and in town stops; by constant pull and slowing."""
    kind, out, speed, k = KINDS[scenario], np.empty(n), 0.0, 0
    goal = speed = allowed(rng, kind)
    left, up, down = rng.uniform(2.0, 15.0), 0.5, 0.5
    for k in range(n):
        left -= dt
        if left <= 0.0 and abs(speed - goal) < 0.05:
            stops = scenario == "suburban" and goal > 0.0 and rng.random() < kind.stops
            goal = 0.0 if stops else allowed(rng, kind)
            left = rng.uniform(6.0, 15.0) if stops else 4.0 + rng.exponential(kind.lasts_s)
            up, down = rng.uniform(*kind.pull), rng.uniform(*kind.slow)
        speed += np.clip(goal - speed, -down * dt, up * dt)
        out[k] = speed
    return out


def _follows(rng: np.random.Generator, ahead: Array, floor: float, dt: float) -> Array:
    """Speed (n,) of who drives behind `ahead`, by what he saw a moment ago."""
    seen, headway = round(rng.uniform(0.3, 0.9) / dt), rng.uniform(1.3, 2.1)
    pulls, looks = rng.uniform(0.05, 0.12), rng.uniform(0.35, 0.6)
    out, speed = np.empty(len(ahead)), float(ahead[0])
    gap = GAP_M + headway * speed
    gaps, speeds = [gap] * (seen + 1), [speed] * (seen + 1)
    for k, pace in enumerate(ahead):
        then = ahead[max(k - seen, 0)]
        wish = looks * (then - speeds[0]) + pulls * (gaps[0] - GAP_M - headway * speeds[0])
        speed = max(speed + dt * float(np.clip(wish, -1.9, 0.9)), floor)
        gap = max(gap + dt * (pace - speed), 1.0)
        if pace < 0.5 and speed < 4.0 and gap < 3.0 * GAP_M:  # creeps no further
            speed = max(speed - 0.9 * dt, floor)
        gaps, speeds = [*gaps[1:], gap], [*speeds[1:], speed]
        out[k] = speed
    return out


def convoys(rng: np.random.Generator, scenario: str, n: int, dt: float) -> Array:
    """In a convoy behind one to three others: what the first one does comes down the row late, and swings
    wider from one to the next. (Helly, Simulation of Bottlenecks in Single-Lane Traffic Flow, 1959, and
    Herman, Montroll, Potts and Rothery, Traffic Dynamics, Operations Research 7, 1959; numbers are chosen
    here.)"""
    floor = FLOOR.get(scenario, 0.0)
    speed = _first_of_them(rng, scenario, n, dt)
    for _ in range(int(rng.integers(*LOOKS[scenario]))):
        speed = _follows(rng, speed, floor, dt)
    return finish(rng, speed, dt, 0.2, 10.0, floor)
