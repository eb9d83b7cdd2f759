"""Roads over karst and down lava steps, and speeds along a round with its obstacles."""

from __future__ import annotations

import numpy as np

from deeptruck_exam.effects.law import Array
from deeptruck_exam.worlds.roads import CELLS, STEEPEST, STEP_M
from deeptruck_exam.worlds.traffic import FLOOR, KINDS, Kind, allowed, finish

OBSTACLES_S = {"highway": 75.0, "suburban": 28.0, "hills": 45.0, "descent": 40.0}  # from one to the next


def _smooth(slope: Array, cells: int) -> Array:
    ease = np.hanning(cells) / np.hanning(cells).sum()
    return np.asarray(np.convolve(slope, ease, mode="same"))


def karst(rng: np.random.Generator, amplitude: float) -> Array:
    """In and out of sinkholes: basins with round floors, sides that are steepest half way up, and saddles
    between them (Ford and Williams, Karst Hydrogeology and Geomorphology, 2007, on dolines)."""
    height, at = np.zeros(CELLS + 600), round(rng.uniform(0.0, 300.0) / STEP_M)
    while at < CELLS:
        cells = round(float(np.clip(rng.lognormal(np.log(520.0), 0.5), 220.0, 1700.0)) / STEP_M)
        across = np.linspace(-1.0, 1.0, cells)
        height[at : at + cells] -= cells * rng.uniform(0.5, 1.1) * (1.0 - across**2) ** 2
        at += round(cells * rng.uniform(0.75, 1.05) + rng.exponential(90.0) / STEP_M)
    slope = _smooth(np.diff(height, append=0.0)[:CELLS], 11)
    limit = 2.2 * amplitude
    return np.clip(limit * np.tanh(amplitude * slope / slope.std() / limit), -STEEPEST, STEEPEST)


def lava_down(rng: np.random.Generator) -> Array:
    """Down a pile of lava flows: a steep front at each edge, a tread that dips a little, of any thickness
    (Macdonald, Volcanoes, 1972, on stepped flows of plateau basalt)."""
    grade, at = np.empty(CELLS), 0
    while at < CELLS:
        front = at + round((90.0 + rng.gamma(2.0, 110.0)) / STEP_M)
        tread = front + round((60.0 + rng.exponential(170.0)) / STEP_M)
        grade[at:front] = -rng.uniform(0.052, 0.070)
        grade[front:tread] = -rng.uniform(0.024, 0.040)
        at = tread
    return np.clip(_smooth(grade, 19), -STEEPEST, -0.012)


def errands(rng: np.random.Generator, scenario: str, n: int, dt: float) -> Array:
    """A wished speed that is neared as by a spring and damper, and obstacles that come by chance: each is
    slowed for, passed and left behind, some are stops (Gipps, A Behavioural Car-Following Model, Transp. Res.
    B 15, 1981, on braking early enough; obstacles are chosen here)."""
    kind, floor = KINDS[scenario], FLOOR.get(scenario, 0.0)
    wished = _wishes(rng, kind, n, dt)
    limit, at = np.full(n, 99.0), rng.exponential(OBSTACLES_S[scenario])
    while at < n * dt:
        stops = rng.random() < kind.stops
        through = 0.0 if stops else max(rng.uniform(0.45, 0.85) * kind.speeds[1], floor)
        waits = 2.0 + rng.gamma(2.0, 3.0) if stops else rng.uniform(0.5, 3.0)
        limit = np.minimum(limit, _past(rng, kind, at, (through, waits), n, dt))
        at += waits + 12.0 + rng.gamma(2.0, 0.5 * OBSTACLES_S[scenario])
    return finish(rng, np.minimum(wished, limit), dt, 0.28, 8.0, floor)


def _wishes(rng: np.random.Generator, kind: Kind, n: int, dt: float) -> Array:
    """Speed (n,) that signs ask for, neared with a little too much at first."""
    asked, at = np.empty(n), 0
    while at < n:
        end = at + round((6.0 + rng.gamma(1.6, 0.8 * kind.lasts_s)) / dt)
        asked[at:end], at = min(allowed(rng, kind), 26.0), end
    speed, pace, out = asked[0], 0.0, np.empty(n)
    omega, damping = rng.uniform(0.12, 0.2), rng.uniform(0.75, 1.0)
    for k in range(n):
        push = omega**2 * (asked[k] - speed) - 2.0 * damping * omega * pace
        pace = float(np.clip(pace + dt * push, -kind.slow[1], kind.pull[1]))
        speed += dt * pace
        out[k] = speed
    return out


def _past(
    rng: np.random.Generator, kind: Kind, at: float, slow: tuple[float, float], n: int, dt: float
) -> Array:
    """Speed (n,) that one obstacle at the time `at` leaves: (speed, seconds) there are `slow`."""
    clock, (through, waits) = np.arange(n) * dt, slow
    before = np.maximum(at - clock, 0.0) * rng.uniform(*kind.slow)
    since = np.maximum(clock - at - waits, 0.0)
    pull = rng.uniform(*kind.pull)
    after = 27.0 * (1.0 - np.exp(-1.3 * pull * since / 27.0))
    return np.asarray(through + before + after)
