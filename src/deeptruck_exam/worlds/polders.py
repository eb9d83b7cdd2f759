"""Roads over the dykes of polders and down a hillside by hairpins, and speeds that lapse until one looks."""

from __future__ import annotations

import numpy as np

from deeptruck_exam.effects.law import Array
from deeptruck_exam.worlds.roads import CELLS, STEEPEST, STEP_M
from deeptruck_exam.worlds.traffic import FLOOR, KINDS, Kind, allowed, finish

FIELD_M = 210.0  # usual way over one polder, from dyke to dyke
HUMPS_M = {
    "highway": (1200.0, 3200.0),
    "suburban": (220.0, 700.0),
    "hills": (500.0, 1500.0),
    "descent": (250.0, 800.0),
}
OPENED = 0.45  # of bridges in town, that are open for a boat
NOTICES = (0.03, 0.09)  # of the speed, that it may have lapsed by before one looks


def polders(rng: np.random.Generator, amplitude: float) -> Array:
    """Level polders of several heights, and dykes between them: a straight ramp up, a crest as wide as a
    road, a straight ramp down that is longer or shorter by what the next polder lies lower or higher. (Van de
    Ven, Man-made Lowlands, 2004, on polders and their levels; lengths are chosen here.)"""
    slope, at, low = np.zeros(CELLS + 400), -round(rng.uniform(0.0, FIELD_M) / STEP_M), 0.0
    while at < CELLS:
        field = max(round(FIELD_M * rng.lognormal(0.0, 0.5) / STEP_M), 4)
        after = np.clip(low + rng.normal(0.0, 0.8), -2.5, 2.5)
        crest = max(low, after) + rng.uniform(3.0, 8.0)
        steep = rng.uniform(0.8, 1.2)
        up, down = (max(round(rise / (0.055 * steep) / STEP_M), 3) for rise in (crest - low, crest - after))
        for cells, way in ((field, 0.0), (up, steep), (2, 0.0), (down, -steep)):
            slope[max(at, 0) : max(at + cells, 0)] = way
            at += cells
        low = float(after)
    ease = np.hanning(11) / np.hanning(11).sum()
    along = np.convolve(slope[:CELLS], ease, mode="same")
    return np.clip(amplitude * along / along.std(), -STEEPEST, STEEPEST)


def hairpins_down(rng: np.random.Generator) -> Array:
    """Down a hillside by straight legs of one slope each, which ease in the hairpin between two of them; the
    hillside gets steeper and flatter over many legs. (AASHTO, A Policy on Geometric Design, 2018, on slopes
    that are eased through sharp curves; lengths are chosen here.)"""
    grade, at = np.empty(CELLS + 200), 0
    phase, legs = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(9.0, 15.0)
    leg = 0
    while at < CELLS:
        cells = round(rng.uniform(220.0, 650.0) / STEP_M)
        hill = 0.055 + 0.009 * np.sin(2.0 * np.pi * leg / legs + phase) + rng.uniform(-0.003, 0.003)
        grade[at : at + cells] = -hill
        at += cells
        bend = round(rng.uniform(60.0, 110.0) / STEP_M)
        grade[at : at + bend] = -rng.uniform(0.014, 0.022)
        at, leg = at + bend, leg + 1
    ease = np.hanning(7) / np.hanning(7).sum()
    return np.clip(np.convolve(grade[:CELLS], ease, mode="same"), -STEEPEST, -0.012)


def _hump(
    rng: np.random.Generator, scenario: str, kind: Kind, after: float, floor: float
) -> tuple[float, float, float]:
    """Place m, the speed that it is passed at, and s that are waited there."""
    at = after + rng.uniform(*HUMPS_M[scenario])
    if scenario == "suburban" and rng.random() < OPENED:
        return at, 0.0, 6.0 + rng.gamma(2.0, 8.0)
    return at, max(float(rng.uniform(*kind.pass_mps)), floor + 0.3), 0.0


def lapses(rng: np.random.Generator, scenario: str, n: int, dt: float) -> Array:
    """The foot stays where it is and the speed lapses, up or down, until one looks and sets it right at once.
    Humps of bridges are passed slowly, and in town some bridges are open: one waits for the boat. (Todosiev
    and Barbosa, A Proposed Model for the Driver-Vehicle-System, Traffic Engineering 34, 1964, on drivers who
    act at thresholds alone; numbers are chosen here.)"""
    kind, floor = KINDS[scenario], FLOOR.get(scenario, 0.0)
    usual, bears = allowed(rng, kind), rng.uniform(*NOTICES)
    up, down = rng.uniform(*kind.pull), rng.uniform(*kind.slow)
    out, speed, way, waits = np.empty(n), usual, 0.0, 0.0
    drifts, sets_right, left = rng.normal(0.0, 0.05), False, 6.0 + rng.exponential(kind.lasts_s)
    hump = _hump(rng, scenario, kind, 0.0, floor)
    for k in range(n):
        place, past, stays = hump
        limit = np.sqrt(past**2 + 2.0 * down * max(place - way, 0.0))
        wrong = usual - speed
        sets_right = abs(wrong) > bears * usual or (sets_right and abs(wrong) > 0.15)
        if waits > 0.0:
            speed, waits = 0.0, waits - dt
        elif limit < speed:
            speed = max(speed - 1.25 * down * dt, limit)
        elif sets_right:
            speed += dt * (up * np.clip(1.4 * wrong, 0.0, 1.0) - down * np.clip(-wrong, 0.0, 1.0))
            drifts = rng.normal(0.0, 0.05)
        else:
            speed += dt * drifts
        speed = float(np.clip(min(speed, max(limit, 0.0)), floor, 27.0))
        way, left = way + speed * dt, left - dt
        if way >= place or (past == 0.0 and place - way < 0.4):
            waits, way = stays, max(way, place)
            hump = _hump(rng, scenario, kind, place, floor)
            up, down = rng.uniform(*kind.pull), rng.uniform(*kind.slow)
        if left <= 0.0:
            usual, bears = allowed(rng, kind), rng.uniform(*NOTICES)
            left = 6.0 + rng.exponential(kind.lasts_s)
        out[k] = speed
    return finish(rng, out, dt, 0.15, 9.0, floor)
