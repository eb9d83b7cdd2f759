"""Roads over fields of cinder cones and down the flanks of volcanoes, and speeds from light to light."""

from __future__ import annotations

import numpy as np

from deeptruck_exam.effects.law import Array
from deeptruck_exam.effects.series import ou_series
from deeptruck_exam.worlds.roads import CELLS, STEEPEST, STEP_M
from deeptruck_exam.worlds.traffic import FLOOR, KINDS, Kind, allowed, finish

APART_M = {  # of lights
    "highway": (900.0, 2600.0),
    "suburban": (140.0, 480.0),
    "hills": (500.0, 1500.0),
    "descent": (300.0, 900.0),
}
LOOKS_M = {"highway": 420.0, "suburban": 130.0, "hills": 260.0, "descent": 180.0}  # how far lights are seen


def _smooth(slope: Array, cells: int) -> Array:
    ease = np.hanning(cells) / np.hanning(cells).sum()
    return np.asarray(np.convolve(slope, ease, mode="same"))


def cones(rng: np.random.Generator, amplitude: float) -> Array:
    """Over a field of cinder cones: up an even flank, down into the crater and out of it again, down the
    other flank; lava plains that dip a little between them. (Settle, The Structure and Emplacement of Cinder
    Cone Fields, American Journal of Science 279, 1979, on even flanks and craters; lengths are chosen
    here.)"""
    slope, at = np.zeros(CELLS + 900), -round(rng.uniform(0.0, 500.0) / STEP_M)
    while at < CELLS:
        flank = max(round(380.0 * rng.lognormal(0.0, 0.4) / STEP_M), 12)
        crater = max(round(flank * rng.uniform(0.2, 0.45)), 5)
        steep, bowl = rng.uniform(0.75, 1.25), rng.uniform(0.6, 1.1)
        plain = max(round((60.0 + rng.exponential(260.0)) / STEP_M), 4)
        pieces = ((flank, steep), (crater, -bowl), (crater, bowl), (flank, -steep))
        for cells, way in (*pieces, (plain, rng.normal(0.0, 0.12))):
            slope[max(at, 0) : max(at + cells, 0)] = way
            at += cells
    along = _smooth(slope[:CELLS], 9)
    limit = 2.2 * amplitude
    return np.clip(limit * np.tanh(amplitude * along / along.std() / limit), -STEEPEST, STEEPEST)


def flanks_down(rng: np.random.Generator) -> Array:
    """Down the flank of a great volcano, which flattens exponentially from its top, and on its way into and
    out of the ravines that part its ribs: first flatter, then steeper. (Karátson, Favalli, Tarquini and
    others, The Regular Shape of Stratovolcanoes, J. Volcanology and Geothermal Research 193, 2010; lengths
    are chosen here.)"""
    grade, at = np.empty(CELLS + 1200), 0
    while at < CELLS:
        cells = round(rng.uniform(4000.0, 9000.0) / STEP_M)
        along = np.arange(cells) * STEP_M
        flank = -0.034 - rng.uniform(0.024, 0.032) * np.exp(-along / rng.uniform(1800.0, 3200.0))
        rib = rng.uniform(0.0, 300.0)
        while rib < along[-1]:
            wide = rng.uniform(130.0, 320.0)
            into = np.clip((along - rib) / wide, 0.0, 1.0)
            flank = flank + rng.uniform(0.012, 0.02) * np.sin(2.0 * np.pi * into)
            rib += wide + rng.exponential(250.0)
        grade[at : at + cells] = flank
        at += cells
    return np.clip(_smooth(grade[:CELLS], 5), -STEEPEST, -0.012)


def _next_light(rng: np.random.Generator, scenario: str, after: float) -> tuple[float, float, float, float]:
    """Place m, cycle s, share that is green, and phase of the light after a place."""
    at = after + rng.uniform(*APART_M[scenario])
    return at, rng.uniform(45.0, 100.0), rng.uniform(0.35, 0.65), rng.uniform(0.0, 1.0)


def _rolls_through(rng: np.random.Generator, kind: Kind, usual: float, floor: float) -> float:
    """The speed that a sign asks for while it is lit, outside of towns."""
    return max(float(rng.uniform(0.55, 0.85)) * usual, 0.8 * kind.pass_mps[0], floor + 0.3)


def lights(rng: np.random.Generator, scenario: str, n: int, dt: float) -> Array:
    """From light to light. In town a red one is stopped at, and after green one waits for those ahead to
    start; elsewhere lit signs ask for less. Nobody brakes for what is too near. Between lights the wish
    wanders. (Webster, Traffic Signal Settings, 1958, on cycles and lost time, and Treiber and Kesting,
    Traffic Flow Dynamics, 2013, on free driving; numbers are chosen here.)"""
    kind, floor, town = KINDS[scenario], FLOOR.get(scenario, 0.0), scenario == "suburban"
    usual = allowed(rng, kind)
    wanders = ou_series(rng, (1, n), dt, 12.0)[0]
    out, speed, way, waits = np.empty(n), usual, 0.0, 0.0
    light, up, down = _next_light(rng, scenario, 0.0), rng.uniform(*kind.pull), rng.uniform(*kind.slow)
    red_through, row, seen = _rolls_through(rng, kind, usual, floor), 0.0, -1.0
    for k in range(n):
        place, cycle, green, phase = light
        left, goal = place - way, usual * (1.0 + 0.02 * wanders[k])
        red = (k * dt / cycle + phase) % 1.0 > green
        end = 0.0 if town else red_through
        if red and left < LOOKS_M[scenario] and (seen == place or speed**2 - end**2 < 2.4 * down * left):
            seen = place  # now he has decided to slow
            room = left - (row if town else 0.0)
            goal = min(goal, np.sqrt(end**2 + 2.0 * down * max(room, 0.0)))
            waits = 1.5 + 0.28 * row if town and speed < 0.3 else 0.0
        elif waits > 0.0:
            goal, waits = 0.0, waits - dt
        pulls = up * (1.0 - min(speed / max(1.12 * goal, 0.5), 1.0) ** 4)
        slows = 1.15 * down * min(1.0, 0.1 + (speed - goal) / 0.6)
        speed = min(speed + pulls * dt, goal) if goal > speed else max(speed - slows * dt, goal, 0.0)
        speed = 0.0 if goal < 0.25 and speed < 0.25 else speed
        way, out[k] = way + speed * dt, speed
        if way > place:
            light, row = _next_light(rng, scenario, place), float(rng.choice([0.0, 7.0, 14.0, 28.0]))
            usual, up, down = allowed(rng, kind), rng.uniform(*kind.pull), rng.uniform(*kind.slow)
            red_through = _rolls_through(rng, kind, usual, floor)
    return finish(rng, out, dt, 0.25, 12.0, floor)
