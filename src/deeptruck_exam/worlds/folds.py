"""Roads over folded ridges and down wavy slopes, and speeds that keep a timetable."""

from __future__ import annotations

import numpy as np

from deeptruck_exam.effects.law import Array
from deeptruck_exam.effects.series import ou_series
from deeptruck_exam.worlds.roads import CELLS, STEEPEST, STEP_M
from deeptruck_exam.worlds.traffic import FLOOR, KINDS, Kind, allowed, finish

LEGS_S = {
    "highway": (60.0, 150.0),
    "suburban": (22.0, 60.0),
    "hills": (45.0, 120.0),
    "descent": (40.0, 110.0),
}
SLACK = {"highway": (0.86, 1.02), "suburban": (0.7, 0.98), "hills": (0.75, 1.02), "descent": (0.75, 1.0)}


def _smooth(slope: Array, cells: int) -> Array:
    ease = np.hanning(cells) / np.hanning(cells).sum()
    return np.asarray(np.convolve(slope, ease, mode="same"))


def folds(rng: np.random.Generator, amplitude: float) -> Array:
    """Over ridges that were folded like a concertina. Straight limbs go up and down at nearly the same
    slope between sharp crests and troughs, shorter towards one end of each belt. (Ramsay and Huber, The
    Techniques of Modern Structural Geology, 1987, on chevron folds; lengths are chosen here.)"""
    slope, at, way = np.zeros(CELLS + 400), -round(rng.uniform(0.0, 400.0) / STEP_M), rng.choice([-1.0, 1.0])
    while at < CELLS:
        limbs, first = int(rng.integers(5, 12)), rng.uniform(300.0, 800.0)
        narrows, steep = rng.uniform(0.86, 1.0), rng.uniform(0.85, 1.15)
        for limb in range(limbs):
            cells = max(round(first * narrows**limb * rng.uniform(0.9, 1.1) / STEP_M), 9)
            low, high = max(at, 0), max(at + cells, 0)
            slope[low:high] = way * steep
            at, way = at + cells, -way
    along = _smooth(slope[:CELLS], 7)
    return np.clip(amplitude * along / along.std(), -STEEPEST, STEEPEST)


def waves_down(rng: np.random.Generator) -> Array:
    """Down a slope whose steepness swells and falls like a wave, ever longer towards its foot, and over the
    edge of the next one. (Carson and Kirkby, Hillslope Form and Process, 1972, on slopes of hard and soft
    beds by turns; lengths are chosen here.)"""
    grade, at = np.empty(CELLS + 900), 0
    while at < CELLS:
        cells = round(rng.uniform(1800.0, 4500.0) / STEP_M)
        long, grows = rng.uniform(18.0, 35.0), rng.uniform(1.0, 2.2)
        along = np.arange(cells)
        turns = np.log1p((grows - 0.99) * along / cells) * cells / (grows - 0.99) / long
        grade[at : at + cells] = -0.046 - rng.uniform(0.017, 0.025) * np.sin(2.0 * np.pi * turns)
        at += cells
    return np.clip(_smooth(grade[:CELLS], 5), -STEEPEST, -0.012)


def _leg(rng: np.random.Generator, kind: Kind, seconds: float, pace: tuple[float, float], dt: float) -> Array:
    """Speed (steps,) from one point of the timetable to the next: the late hurry, the early linger."""
    steps = round(seconds / dt)
    wanders = np.convolve(ou_series(rng, (1, steps + 80), dt, 9.0)[0], np.hanning(81) / 40.0, "valid")[:steps]
    usual = allowed(rng, kind)
    planned, done, out = usual * rng.uniform(*pace) * seconds, 0.0, np.empty(steps)
    for k in range(steps):
        left = max(seconds - k * dt, 8.0)
        wish = float(np.clip((planned - done) / left, 0.7 * usual, 1.06 * usual))
        out[k] = wish * (1.0 + 0.03 * wanders[k])
        done += dt * out[k] * (1.0 if rng.random() > 0.002 else 0.0)
    return out


def timetable(rng: np.random.Generator, scenario: str, n: int, dt: float) -> Array:
    """From point to point of a timetable, with some slack that is driven off slowly; what is lost on the way
    is caught up before the next point. Points are slow, and in town most are stops. (Vuchic, Urban Transit:
    Operations, Planning and Economics, 2005, on timed points and slack; numbers are chosen here.)"""
    kind, floor = KINDS[scenario], FLOOR.get(scenario, 0.0)
    out, length = [np.full(round(rng.uniform(0.5, 4.0) / dt), allowed(rng, kind))], 0
    while length < n:
        out.append(_leg(rng, kind, rng.uniform(*LEGS_S[scenario]), SLACK[scenario], dt))
        if scenario == "suburban" and rng.random() < 0.75:
            out.append(np.zeros(round((3.0 + rng.exponential(7.0)) / dt)))
        else:
            slow = max(float(rng.uniform(0.55, 0.85)) * float(out[-1][-1]), floor + 0.3)
            out.append(np.full(round(rng.uniform(3.0, 10.0) / dt), slow))
        length = sum(len(piece) for piece in out)
    return finish(rng, _driven(rng, kind, np.concatenate(out)[:n], dt), dt, 0.15, 15.0, floor)


def _driven(rng: np.random.Generator, kind: Kind, wish: Array, dt: float) -> Array:
    """The wishes as a driver can follow them: slowing that begins early enough, and pulls that fade out."""
    out, down = wish.copy(), rng.uniform(*kind.slow)
    for k in range(len(out) - 2, -1, -1):
        out[k] = min(out[k], out[k + 1] + down * dt)
    up, speed = rng.uniform(*kind.pull), float(out[0])
    for k, goal in enumerate(out):
        gains = up * min(1.0, 0.15 + 0.5 * max(goal - speed, 0.0))
        speed = min(goal, speed + gains * dt) if goal > speed else float(goal)
        out[k] = speed
    return out
