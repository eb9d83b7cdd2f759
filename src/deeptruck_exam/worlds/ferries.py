"""Roads along fjords and down their troughs, and speeds on narrow roads that ferries fill and empty."""

from __future__ import annotations

import numpy as np

from deeptruck_exam.effects.law import Array
from deeptruck_exam.worlds.roads import CELLS, STEEPEST, STEP_M
from deeptruck_exam.worlds.traffic import FLOOR, KINDS, allowed, finish

MEETS_S = {"highway": 70.0, "suburban": 14.0, "hills": 48.0, "descent": 45.0}  # in a full hour
FERRY_S = (120.0, 420.0)  # from one ferry to the next
PASSES = {"highway": (0.66, 0.85), "suburban": (0.25, 0.6), "hills": (0.4, 0.7), "descent": (0.5, 0.75)}


def _smooth(slope: Array, cells: int) -> Array:
    ease = np.hanning(cells) / np.hanning(cells).sum()
    return np.asarray(np.convolve(slope, ease, mode="same"))


def fjords(rng: np.random.Generator, amplitude: float) -> Array:
    """Along a shore: over headlands, down into tunnels under the water and up again, over high bridges, and
    level between (Statens vegvesen, handbook N500 on road tunnels, on slopes of those under the sea)."""
    profile, at = np.zeros(CELLS + 900), round(rng.uniform(0.0, 300.0) / STEP_M)
    while at < CELLS:
        first = rng.choice([-1.0, 1.0, 1.0])  # a tunnel or a height
        cells = [round(rng.uniform(180.0, 900.0) / STEP_M), round(rng.exponential(120.0) / STEP_M)]
        slope, ratio = rng.uniform(0.6, 1.2), rng.uniform(0.7, 1.4)
        profile[at : at + cells[0]] = first * slope
        at += cells[0] + cells[1]
        back = round(cells[0] * ratio)
        profile[at : at + back] = -first * slope / ratio
        at += back + round((40.0 + rng.exponential(380.0)) / STEP_M)
    along = _smooth(profile[:CELLS], 15)
    limit = 2.2 * amplitude
    return np.clip(limit * np.tanh(amplitude * along / along.std() / limit), -STEEPEST, STEEPEST)


def troughs_down(rng: np.random.Generator) -> Array:
    """Down a trough that ice has left in steps: bars that steepen to their foot, and basins behind them
    (Benn and Evans, Glaciers and Glaciation, 2010, on stepped profiles)."""
    grade, at = np.empty(CELLS), 0
    while at < CELLS:
        bar, basin = (
            round((lowest + rng.gamma(2.0, mean)) / STEP_M) for lowest, mean in ((200, 130), (80, 90))
        )
        grade[at : at + bar] = -np.linspace(rng.uniform(0.04, 0.048), rng.uniform(0.062, 0.07), bar)[
            : CELLS - at
        ]
        grade[at + bar : at + bar + basin] = -rng.uniform(0.022, 0.034)
        at += bar + basin
    return np.clip(_smooth(grade, 13), -STEEPEST, -0.012)


def _reach(first: float, last: float, seconds: float, dt: float) -> Array:
    """From one speed to another without a jerk at either end (Flash and Hogan, The Coordination of Arm
    Movements, J. Neuroscience 5, 1985, on movements of least jerk)."""
    share = np.arange(max(2, round(seconds / dt))) / max(2, round(seconds / dt))
    return np.asarray(first + (last - first) * share**3 * (10.0 - 15.0 * share + 6.0 * share**2))


def narrow(rng: np.random.Generator, scenario: str, n: int, dt: float) -> Array:
    """A road with passing places: others come the other way in crowds, behind each ferry, and some are
    waited for, in town at rest at the third one at the latest; ferries and places are chosen here."""
    kind, floor = KINDS[scenario], FLOOR.get(scenario, 0.0)
    speed, period, phase = allowed(rng, kind), rng.uniform(*FERRY_S), rng.uniform(0.0, 1.0)
    out, clock, last = [np.full(round(rng.uniform(1.0, 8.0) / dt), speed)], 0.0, 0
    while clock < n * dt:
        crowd = 0.35 + 0.65 * (np.sin(2.0 * np.pi * (clock / period + phase)) > 0.0)
        cruise = allowed(rng, kind)
        up = 1.9 * abs(cruise - speed) / rng.uniform(*(kind.pull if cruise > speed else kind.slow))
        stops = rng.random() < kind.stops or (scenario == "suburban" and last > 1)
        last = 0 if stops else last + 1
        through = 0.0 if stops else max(rng.uniform(*PASSES[scenario]) * cruise, floor)
        slow = 1.9 * (cruise - through) / rng.uniform(*kind.slow)
        waits = 2.0 + rng.gamma(2.0, 2.0) if stops else rng.uniform(1.0, 4.0)
        holds = 3.0 + rng.exponential(MEETS_S[scenario] / crowd) * 0.6
        out.append(_reach(speed, cruise, up + 0.5, dt))
        out.append(np.full(round(holds / dt), cruise))
        out.append(_reach(cruise, through, slow + 0.5, dt))
        out.append(np.full(round(waits / dt), through))
        speed, clock = through, dt * sum(len(piece) for piece in out)
    return finish(rng, np.concatenate(out)[:n], dt, 0.3, 11.0, floor)
