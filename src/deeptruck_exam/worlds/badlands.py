"""Roads through badlands and down their knicks, and speeds that fog allows."""

from __future__ import annotations

import numpy as np

from deeptruck_exam.effects.law import Array
from deeptruck_exam.effects.series import ou_series
from deeptruck_exam.worlds.roads import CELLS, STEEPEST, STEP_M
from deeptruck_exam.worlds.traffic import FLOOR, KINDS, allowed, finish

ORDERS = ((1100.0, 0.55), (420.0, 0.6), (170.0, 0.5))  # m from crease to crease, and how steep
SIGHT_M = {"highway": 150.0, "suburban": 60.0, "hills": 95.0, "descent": 75.0}  # usual, in fog
THINKS_S, BRAKES_MPS2 = 1.3, 2.2  # of a driver who has to stop for what he sees
CROSSES_S = 24.0  # from one who walks across out of the fog to the next, in town


def _creases(rng: np.random.Generator, apart_m: float) -> Array:
    """Slopes of 1 and -1 by turns, each rise and fall as long as chance has it."""
    cells = np.maximum(np.rint(apart_m * rng.lognormal(0.0, 0.45, CELLS // 4) / STEP_M), 4).astype(int)
    way = np.repeat(np.where(np.arange(len(cells)) % 2, -1.0, 1.0), cells)
    return np.asarray(way[rng.integers(0, 200) :][:CELLS])


def badlands(rng: np.random.Generator, amplitude: float) -> Array:
    """Sharp ridges and sharp gullies, and smaller ones on the sides of larger ones: even slopes that meet in
    creases, of three orders. (Horton, Erosional Development of Streams and Their Drainage Basins, GSA
    Bulletin 56, 1945, on orders of streams, and Schumm, Evolution of Drainage Systems and Slopes in Badlands,
    GSA Bulletin 67, 1956, on straight slopes; lengths are chosen here.)"""
    along = sum((steep * _creases(rng, apart) for apart, steep in ORDERS), np.zeros(CELLS))
    ease = np.hanning(5) / np.hanning(5).sum()
    along = np.convolve(along, ease, mode="same")
    return np.clip(amplitude * along / along.std(), -STEEPEST, STEEPEST)


def knicks_down(rng: np.random.Generator) -> Array:
    """Down a valley that is cut backwards: from each knick on the slope is steep and flattens as the water
    has worn it, until the next, harder layer. (Whipple and Tucker, Dynamics of the Stream-Power River
    Incision Model, J. Geophysical Research 104, 1999, on knicks that travel up; lengths are chosen here.)"""
    grade, at = np.empty(CELLS + 400), 0
    while at < CELLS:
        cells = round(rng.uniform(350.0, 1500.0) / STEP_M)
        along = np.arange(cells) * STEP_M
        worn = np.exp(-along / rng.uniform(180.0, 480.0))
        grade[at : at + cells] = -rng.uniform(0.026, 0.036) - rng.uniform(0.022, 0.042) * worn
        at += cells
    ease = np.hanning(7) / np.hanning(7).sum()
    return np.clip(np.convolve(grade[:CELLS], ease, mode="same"), -STEEPEST, -0.012)


def _by_sight(metres: Array) -> Array:
    """The speed from which one can stop within what one sees."""
    thought = THINKS_S * BRAKES_MPS2
    return np.asarray(np.sqrt(thought**2 + 2.0 * BRAKES_MPS2 * metres) - thought)


def _held_at(rng: np.random.Generator, wish: Array, dt: float) -> Array:
    """The wish, and 0 where somebody walks across."""
    at = rng.exponential(CROSSES_S)
    while at < len(wish) * dt:
        waits = rng.uniform(11.0, 28.0)  # with the slowing
        wish[int(at / dt) : int((at + waits) / dt)] = 0.0
        at += waits + 12.0 + rng.exponential(CROSSES_S)
    return wish


def fog(rng: np.random.Generator, scenario: str, n: int, dt: float) -> Array:
    """As fast as one sees, and no faster than allowed: fog lies in banks, between which it is clear. Drivers
    slow at once as they run into one and gather speed slowly behind it; in town they stop for who crosses.
    (Hassan and Abdel-Aty, Predicting Reduced Visibility Related Crashes, J. Safety Research 45,
    2013, and AASHTO, A Policy on Geometric Design, 2018, on sight to stop; numbers are chosen here.)"""
    kind, floor = KINDS[scenario], FLOOR.get(scenario, 0.0)
    banks, wisps = ou_series(rng, (1, n), dt, 25.0)[0], ou_series(rng, (1, n), dt, 6.0)[0]
    sight = SIGHT_M[scenario] * np.exp(0.55 * banks + 0.15 * wisps)
    wish = np.minimum(_by_sight(sight), allowed(rng, kind))
    wish = np.maximum(wish, max(floor + 0.2, 0.6 * kind.pass_mps[0]))
    if scenario == "suburban":
        wish = _held_at(rng, wish, dt)
    out, speed = np.empty(n), float(wish[0])
    up, down = rng.uniform(*kind.pull), rng.uniform(*kind.slow)
    for k, goal in enumerate(wish):
        pulls = up * (1.0 - 0.6 * min(speed / max(float(goal), 0.5), 1.0))
        speed = min(speed + pulls * dt, goal) if goal > speed else max(speed - down * dt, goal)
        out[k] = speed
    return finish(rng, out, dt, 0.2, 10.0, floor)
