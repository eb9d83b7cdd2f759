"""Roads over basins and ranges, down to their lakes of salt, and speeds behind others on long roads."""

from __future__ import annotations

import numpy as np

from deeptruck_exam.effects.law import Array
from deeptruck_exam.effects.series import ou_series
from deeptruck_exam.worlds.roads import CELLS, STEEPEST, STEP_M
from deeptruck_exam.worlds.traffic import FLOOR, KINDS, Kind, allowed, finish

FREE_S = {"highway": 28.0, "suburban": 9.0, "hills": 20.0, "descent": 18.0}  # until one catches up
BEHIND_S = {"highway": 22.0, "suburban": 8.0, "hills": 20.0, "descent": 24.0}  # until one can pass
SLOWER = {"highway": (0.68, 0.9), "suburban": (0.35, 0.75), "hills": (0.45, 0.8), "descent": (0.5, 0.8)}


def _smooth(slope: Array, cells: int) -> Array:
    ease = np.hanning(cells) / np.hanning(cells).sum()
    return np.asarray(np.convolve(slope, ease, mode="same"))


def basins(rng: np.random.Generator, amplitude: float) -> Array:
    """Level over a salt lake, up a fan that steepens all the way to a pass, and at once down the other side,
    ever flatter, to the next lake. (Blair and McPherson, Alluvial Fans and their Natural Distinction from
    Rivers, J. Sedimentary Research A64, 1994, on concave fans; lengths are chosen here.)"""
    slope, at = np.zeros(CELLS + 900), round(rng.uniform(0.0, 400.0) / STEP_M)
    while at < CELLS:
        high, bent = rng.uniform(14.0, 34.0), rng.uniform(2.2, 4.0)
        for way, steep in ((1.0, rng.uniform(0.7, 1.2)), (-1.0, rng.uniform(0.7, 1.2))):
            cells = round(high * bent / (0.045 * steep) / STEP_M)
            rise = steep * np.exp(-bent * np.arange(cells) / cells)
            slope[at : at + cells] += (way * (rise[::-1] if way > 0.0 else rise))[: len(slope) - at]
            at += cells
        at += round((250.0 + rng.exponential(500.0)) / STEP_M)
    along = _smooth(slope[:CELLS], 13)
    limit = 2.2 * amplitude
    return np.clip(limit * np.tanh(amplitude * along / along.std() / limit), -STEEPEST, STEEPEST)


def washes_down(rng: np.random.Generator) -> Array:
    """Down a fan of one slope that dry washes have cut: into each one steeply, and level over its bed (Cooke,
    Warren and Goudie, Desert Geomorphology, 1993, on trenched fans)."""
    grade, at = np.empty(CELLS), 0
    while at < CELLS:
        fan = at + round((150.0 + rng.exponential(350.0)) / STEP_M)
        bank = fan + round(rng.uniform(60.0, 170.0) / STEP_M)
        bed = bank + round(rng.uniform(40.0, 110.0) / STEP_M)
        grade[at:fan] = -rng.uniform(0.040, 0.052)
        grade[fan:bank] = -rng.uniform(0.066, 0.074)
        grade[bank:bed] = -rng.uniform(0.012, 0.018)
        at = bed
    return np.clip(_smooth(grade, 9), -STEEPEST, -0.012)


def _gains(speed: float, goal: float, pull: float, dt: float) -> Array:
    """Up to the goal with the power that is left: its square grows evenly."""
    steps = max(2, round((goal**2 - speed**2) / (2.0 * pull * max(goal, 4.0)) / 0.6 / dt))
    squares = np.linspace(max(speed, 0.6) ** 2, goal**2, steps)
    first = np.linspace(speed, max(speed, 0.6), max(1, round((max(speed, 0.6) - speed) / 0.8 / dt)))
    return np.concatenate([first, np.sqrt(squares)])


def _loses(speed: float, goal: float, slow: float, dt: float) -> Array:
    """Down to the goal by half a wave, as one who sees it in time."""
    steps = max(4, round(1.5 * (speed - goal) / slow / dt))
    return np.asarray(goal + 0.5 * (speed - goal) * (1.0 + np.cos(np.pi * np.arange(steps) / steps)))


def _queue(rng: np.random.Generator, kind: Kind, speed: float, dt: float) -> list[Array]:
    """To a crossing where everybody stops and goes in turn: place by place, each time for a moment."""
    out = [_loses(speed, 0.0, rng.uniform(*kind.slow), dt), np.zeros(round(rng.uniform(2.0, 6.0) / dt))]
    for _ in range(int(rng.integers(0, 4))):
        along = np.linspace(0.0, 1.0, round(rng.uniform(5.0, 8.0) / dt))
        out.append(rng.uniform(1.8, 3.2) * np.sin(np.pi * along) ** 2)
        out.append(np.zeros(round(rng.uniform(2.0, 5.0) / dt)))
    return out


def held_up(rng: np.random.Generator, scenario: str, n: int, dt: float) -> Array:
    """A free road until one has caught up with somebody slow, his uneven speed until one can pass, and on; in
    town also crossings where everybody stops (Luttinen, Percent Time-Spent-Following as Performance Measure
    for Two-Lane Highways, Transp. Research Record 1776, 2001, on following by turns; times are chosen
    here)."""
    kind, floor = KINDS[scenario], FLOOR.get(scenario, 0.0)
    speed = allowed(rng, kind)
    out, length, since = [np.full(round(rng.uniform(1.0, 12.0) / dt), speed)], 0, 0
    while length < n:
        free = allowed(rng, kind)
        stops = scenario == "suburban" and (rng.random() < kind.stops or since > 1)
        since = 0 if stops else since + 1
        pull, slow = rng.uniform(*kind.pull), rng.uniform(*kind.slow)
        out.append(_gains(speed, free, pull, dt) if free > speed else _loses(speed, free, slow, dt))
        out.append(np.full(round((2.0 + rng.exponential(FREE_S[scenario])) / dt), free))
        if stops:
            out += _queue(rng, kind, free, dt)
            speed = 0.0
        else:
            his = max(rng.uniform(*SLOWER[scenario]) * free, floor + 0.3)
            out.append(_loses(free, his, slow, dt))
            steps = round((3.0 + rng.gamma(2.0, 0.5 * BEHIND_S[scenario])) / dt)
            uneven = ou_series(rng, (1, steps + 40), dt, 6.0)[0]
            uneven = np.convolve(uneven, np.hanning(41) / 20.0, mode="valid")
            out.append(np.maximum(his + 0.05 * his * uneven * np.sin(np.pi * np.arange(steps) / steps), 0.5))
            speed = his
        length = sum(len(piece) for piece in out)
    return finish(rng, np.concatenate(out)[:n], dt, 0.25, 12.0, floor)
