"""Roads: grade against position, and which recording drives which road in which direction."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from deeptruck_exam.effects.law import Array

STEP_M = 10.0
LENGTH_M = 60000.0
CELLS = round(LENGTH_M / STEP_M)
STEEPEST = 0.075
AMPLITUDE = {"highway": 0.013, "suburban": 0.010, "hills": 0.030, "descent": 0.0}  # standard deviation

Profile = Callable[[np.random.Generator, float], Array]
"""Grade (cells,) of a road of standard deviation `amplitude`."""
WayDown = Callable[[np.random.Generator], Array]
"""Grade (cells,) of a road that goes down, driven forwards."""


@dataclass(frozen=True)
class Roads:
    """`grade` (routes, cells) for driving forwards; per recording the route, the start and +1 or -1."""

    grade: Array
    route: NDArray[np.int64]
    start_m: Array
    direction: Array

    def grade_at(self, distance: Array) -> Array:
        """Slope met by each recording after `distance` (batch,) m, uphill positive."""
        at = (self.start_m + self.direction * distance) / STEP_M % (self.grade.shape[1] - 1)
        low = at.astype(int)
        share = at - low
        value = (1.0 - share) * self.grade[self.route, low] + share * self.grade[self.route, low + 1]
        return np.asarray(self.direction * value)


def draw_roads(
    rng: np.random.Generator, scenarios: list[str], flat: bool, profile: Profile, way_down: WayDown
) -> Roads:
    """A road or two for each kind of drive; two in five drives on all but the way down go the other way."""
    grades: list[Array] = []
    rows: dict[str, list[int]] = {}
    for kind in sorted(set(scenarios)):
        rows[kind] = []
        for _ in range(1 + (scenarios.count(kind) > 3)):
            rows[kind].append(len(grades))
            level = AMPLITUDE[kind] * rng.uniform(0.8, 1.1) + 1e-9
            grades.append(way_down(rng) if kind == "descent" else profile(rng, level))
    route = np.array([rng.choice(rows[kind]) for kind in scenarios])
    back = (rng.random(len(scenarios)) < 0.4) & np.array([kind != "descent" for kind in scenarios])
    start = rng.uniform(8500.0, 11500.0, len(scenarios)) + np.where(back, 5000.0, 0.0)
    grade = np.stack(grades) * (0.0 if flat else 1.0)
    return Roads(grade, route, start, np.where(back, -1.0, 1.0))


def _eased(steps: Array, cells: int) -> Array:
    """Steps of slope with vertical curves, a raised cosine of so many cells."""
    return np.asarray(np.convolve(steps, np.hanning(cells) / np.hanning(cells).sum(), mode="same"))


def _sized(profile: Array, amplitude: float) -> Array:
    return np.clip(amplitude * profile / profile.std(), -STEEPEST, STEEPEST)


def waves(rng: np.random.Generator, amplitude: float) -> Array:
    """Sinusoids of 400 m to 8 km with random phase."""
    position = np.arange(CELLS) * STEP_M
    lengths = np.exp(rng.uniform(np.log(400.0), np.log(8000.0), 14))
    size = rng.rayleigh(1.0, 14) * lengths**0.3
    phase = rng.uniform(0.0, 2.0 * np.pi, (14, 1))
    return _sized(size @ np.sin(2.0 * np.pi * position / lengths[:, None] + phase), amplitude)


def tangents(rng: np.random.Generator, amplitude: float) -> Array:
    """Straight slopes joined by parabolas (AASHTO, A Policy on Geometric Design of Highways and Streets)."""
    ends = np.cumsum(rng.gamma(2.5, 220.0, 600) + 80.0)
    slopes = rng.standard_normal(601)
    slopes = slopes - 0.6 * np.append(0.0, slopes[:-1])  # what goes up comes down
    steps = slopes[np.searchsorted(ends, np.arange(CELLS) * STEP_M)]
    curve = round(rng.uniform(100.0, 220.0) / STEP_M)
    return _sized(np.asarray(np.convolve(steps, np.ones(curve) / curve, mode="same")), amplitude)


def fractal(rng: np.random.Generator, amplitude: float) -> Array:
    """Hills of fractal heights (Voss, Fractals in Nature, 1988: spectrum with the power -2.4 to -3.2 of the
    wave number down to earthworks of some hundred metres), smoothed and limited by a designer."""
    wave = np.fft.rfftfreq(CELLS, STEP_M)
    size = np.where(wave > 1.0 / 9000.0, np.maximum(wave, 1e-9) ** -rng.uniform(1.2, 1.6), 0.0)
    height = size * np.exp(2j * np.pi * rng.random(len(wave))) * np.exp(-((wave * 230.0) ** 2))
    return _limited(np.fft.irfft(2j * np.pi * wave * height, CELLS), amplitude)


def _limited(slope: Array, amplitude: float) -> Array:
    limit = 2.2 * amplitude
    return np.clip(limit * np.tanh(amplitude * slope / slope.std() / limit), -STEEPEST, STEEPEST)


def swell(rng: np.random.Generator, long_m: float, damping: float) -> Array:
    """Unit-variance swelling of a land along a road: a damped oscillator that noise keeps going, of the
    second order in the way (Åström, Introduction to Stochastic Control Theory, 1970)."""
    spare, omega = 1500, 2.0 * np.pi / long_m * STEP_M
    radius = np.exp(-damping * omega)
    poles = [1.0, -2.0 * radius * np.cos(omega * np.sqrt(1.0 - damping**2)), radius**2]
    out = _eased(lfilter([1.0], poles, rng.standard_normal(CELLS + spare))[spare:], 15)
    return np.asarray(out / out.std())


def swells(rng: np.random.Generator, amplitude: float) -> Array:
    """A road over two swells of the land, of which diggers took the steepest."""
    both = swell(rng, rng.uniform(1800.0, 4200.0), 0.35) + 0.6 * swell(rng, rng.uniform(500.0, 1100.0), 0.25)
    return _limited(both, amplitude)


def climbs(rng: np.random.Generator, amplitude: float) -> Array:
    """A road that is flat for long, climbs a valley's side or a flyover on one slope with eased ends, and
    comes down again some way on, by another."""
    profile, at = np.zeros(CELLS + 3000), 0  # the last climb may end beyond
    while at < CELLS:
        at += round(rng.exponential(280.0) / STEP_M)
        rise = rng.choice([-1.0, 1.0]) * 4.0 * rng.gamma(2.0, 1.5)  # m
        for height in (rise, -rise * rng.uniform(0.7, 1.3)):
            slope = rng.uniform(0.6, 1.4)
            length = max(6, round(abs(height) * 28.0 / slope / STEP_M))
            ramp = np.sin(np.pi * (np.arange(length) + 0.5) / length) ** 0.6
            profile[at : at + length] = np.sign(height) * slope * ramp
            at += length + round(rng.exponential(160.0) / STEP_M)
    return _sized(_eased(profile[:CELLS], 13), amplitude)


def laps(rng: np.random.Generator, amplitude: float) -> Array:
    """A lap driven again and again: test hills of one slope each with eased feet, up and down."""
    lap = round(rng.uniform(3200.0, 6400.0) / STEP_M)
    profile, at = np.zeros(lap), 0
    while at < lap - 12:
        up, down = rng.choice([0.5, 0.8, 1.0, 1.3], 2)
        half, side = round(rng.uniform(90.0, 420.0) / STEP_M), rng.choice([-1.0, 1.0])
        back = np.full(round(half * up / down), -side * down)
        hill = np.concatenate([np.full(half, side * up), back])[: lap - at]
        profile[at : at + len(hill)] = hill
        at += len(hill) + round(rng.exponential(140.0) / STEP_M)
    smooth = _eased(np.tile(profile, 3), 11)[lap : 2 * lap]
    smooth = smooth - smooth.mean() + 0.05 * np.sin(2.0 * np.pi * np.arange(lap) / lap)
    return _sized(np.tile(smooth, CELLS // lap + 1)[:CELLS], amplitude)


def cuestas(rng: np.random.Generator, amplitude: float) -> Array:
    """Long gentle slopes up to an edge and a short steep one down, whichever way they look, with level land
    of any length between (cuestas: Summerfield, Global Geomorphology, 1991)."""
    profile, at, looks = np.zeros(CELLS + 600), 0, rng.choice([-1.0, 1.0])
    while at < CELLS:
        looks *= rng.choice([1.0, 1.0, -1.0])
        gentle, steep = round(rng.gamma(3.0, 230.0) / STEP_M) + 8, round(rng.uniform(110.0, 330.0) / STEP_M)
        gentle = min(gentle, 400)
        rise = rng.uniform(6.0, 16.0)
        hill = np.concatenate([np.full(gentle, rise / gentle), np.full(steep, -rise / steep)])
        profile[at : at + len(hill)] = hill if looks > 0.0 else -hill[::-1]
        at += len(hill) + round(rng.exponential(90.0) / STEP_M)
    return _limited(_eased(profile[:CELLS], 11), amplitude)


def drumlins(rng: np.random.Generator, amplitude: float) -> Array:
    """Across a swarm of drumlins: hills of log-normal lengths about 630 m, one behind the other or touching,
    all steeper on the side from which the ice came (Clark, Hughes, Greenwood, Spagnolo and Ng, Size and Shape
    Characteristics of Drumlins, Quaternary Science Reviews 28, 2009)."""
    height, at, came = np.zeros(CELLS + 400), 0, rng.choice([-1.0, 1.0])
    while at < CELLS:
        cells = round(float(np.clip(rng.lognormal(np.log(630.0), 0.45), 250.0, 1800.0)) / STEP_M)
        top = rng.uniform(0.3, 0.45)
        along = (np.arange(cells) + 0.5) / cells
        along = np.where(along < top, 0.5 * along / top, 0.5 + 0.5 * (along - top) / (1.0 - top))
        hill = cells * rng.uniform(0.5, 1.2) * np.sin(np.pi * along) ** 2
        height[at : at + cells] += hill if came > 0.0 else hill[::-1]
        at += round(cells * rng.uniform(0.6, 1.0) + rng.exponential(120.0) / STEP_M)
    return _limited(_eased(np.diff(height, append=0.0)[:CELLS], 11), amplitude)


def steady_down(rng: np.random.Generator) -> Array:
    """One slope."""
    return np.full(CELLS, -rng.uniform(0.045, 0.065))


def ramps_down(rng: np.random.Generator) -> Array:
    """A pass: ramps of 4 to 8 % between flatter bends."""
    ends = np.cumsum(rng.uniform(250.0, 1100.0, 400))
    ramps = rng.uniform(-0.075, -0.042, 401)
    ramps[rng.random(401) < 0.15] = -0.028
    return _eased(ramps[np.searchsorted(ends, np.arange(CELLS) * STEP_M)], 17)


def terraces_down(rng: np.random.Generator) -> Array:
    """A valley in terraces: steeper and flatter by turns, over lengths that change."""
    wave_m = np.exp(np.log(700.0) + 0.45 * swell(rng, 5000.0, 0.4))
    turns = 2.0 * np.pi * np.cumsum(STEP_M / wave_m) + rng.uniform(0.0, 2.0 * np.pi)
    return np.clip(-rng.uniform(0.047, 0.055) + 0.014 * np.tanh(1.6 * np.sin(turns)), -STEEPEST, -0.012)


def hairpins_down(rng: np.random.Generator) -> Array:
    """4 to 7 %, flatter in the hairpins."""
    grade = -rng.uniform(0.050, 0.060) + 0.009 * swell(rng, rng.uniform(900.0, 1800.0), 0.4)
    bends = np.cumsum(rng.gamma(3.0, 190.0, 140) + 150.0)
    return _flatter(grade, bends, np.full(140, 28.0), 0.028, 2)


def viaducts_down(rng: np.random.Generator) -> Array:
    """A motorway's one long slope, eased on viaducts."""
    grade = -rng.uniform(0.046, 0.058) + 0.005 * swell(rng, rng.uniform(1500.0, 3000.0), 0.4)
    middles = np.cumsum(rng.exponential(1100.0, 90) + 500.0)
    return _flatter(grade, middles, rng.uniform(80.0, 200.0, 90), 0.024, 6)


def _flatter(grade: Array, middles: Array, half_m: Array, by: float, power: int) -> Array:
    metres = np.arange(CELLS) * STEP_M
    for middle, half in zip(middles, half_m, strict=True):
        grade = grade + by / (1.0 + ((metres - middle) / half) ** power)
    return np.clip(grade, -STEEPEST, -0.012)


def fans_down(rng: np.random.Generator) -> Array:
    """Down a chain of alluvial fans: steep at each head, ever flatter towards the foot, where the next one
    begins (Bull, The Alluvial-Fan Environment, Progress in Physical Geography 1, 1977: concave profiles)."""
    grade, at = np.empty(CELLS), 0
    while at < CELLS:
        cells = round(rng.uniform(600.0, 2200.0) / STEP_M)
        fall = np.exp(-1.6 * np.arange(cells) / cells)
        grade[at : at + cells] = -(0.026 + rng.uniform(0.038, 0.047) * fall)[: CELLS - at]
        at += cells
    return np.clip(_eased(grade, 13), -STEEPEST, -0.012)


def measured_down(rng: np.random.Generator) -> Array:
    """The way down for brake tests: measured slopes and short landings."""
    grade, at = np.empty(CELLS), 0
    while at < CELLS:
        end = at + round(rng.uniform(500.0, 1800.0) / STEP_M)
        grade[at:end] = -rng.uniform(0.044, 0.066)
        at = end + round(rng.uniform(40.0, 120.0) / STEP_M)
        grade[end:at] = -0.022
    return np.clip(_eased(grade, 9), -STEEPEST, -0.015)


def hummocks(rng: np.random.Generator, amplitude: float) -> Array:
    """Belts of knobs and kettles, without order and one upon the other, between plains of outwash (Benn and
    Evans, Glaciers and Glaciation, 2010, on hummocky moraine); sizes and belts are chosen here."""
    height, at, belt_ends, dense = np.zeros(CELLS), 0.0, 0.0, True
    metres = np.arange(CELLS) * STEP_M
    while at < LENGTH_M:
        if at > belt_ends:
            dense = not dense
            belt_ends = at + rng.uniform(900.0, 2600.0) * (1.0 if dense else 0.5)
        wide = float(np.clip(rng.lognormal(np.log(170.0), 0.45), 90.0, 500.0))
        low, high = (int(np.clip((at + side * wide) / STEP_M, 0, CELLS)) for side in (-3.0, 3.0))
        knob = rng.choice([1.0, 1.0, -1.0]) * wide * rng.uniform(0.4, 1.3)
        height[low:high] += knob * np.exp(-(((metres[low:high] - at) / wide) ** 2))
        at += rng.exponential(180.0 if dense else 900.0)
    return _limited(_eased(np.gradient(height, STEP_M), 13), amplitude)


def slumps_down(rng: np.random.Generator) -> Array:
    """Down a side that has slid: steep scarps, and below each a block that has tilted back, of any length
    (Varnes, Slope Movement Types and Processes, 1978, on rotational slides)."""
    grade, at = np.empty(CELLS), 0
    while at < CELLS:
        scarp = round((120.0 + rng.gamma(2.0, 140.0)) / STEP_M)
        block = round((100.0 + rng.exponential(260.0)) / STEP_M)
        grade[at : at + scarp] = -rng.uniform(0.058, 0.072)
        grade[at + scarp : at + scarp + block] = -rng.uniform(0.022, 0.038)
        at += scarp + block
    return np.clip(_eased(grade, 15), -STEEPEST, -0.012)


def gorges(rng: np.random.Generator, amplitude: float) -> Array:
    """A plateau that rivers have cut: level land, a bend down into each gorge, its floor, and up again, as
    steep as the road's winding allows (Summerfield, Global Geomorphology, 1991, on incised plateaus)."""
    profile, at = np.zeros(CELLS + 400), round(rng.uniform(0.0, 400.0) / STEP_M)
    while at < CELLS:
        down, up = (round(float(np.clip(rng.gamma(5.0, 70.0), 120.0, 800.0)) / STEP_M) for _ in range(2))
        floor, slope = round(rng.exponential(140.0) / STEP_M), rng.uniform(0.6, 1.1)
        profile[at : at + down] = -slope * up / (up + down)
        profile[at + down + floor : at + down + floor + up] = slope * down / (up + down)
        at += down + floor + up + round((60.0 + rng.exponential(330.0)) / STEP_M)
    return _limited(_eased(profile[:CELLS], 13), amplitude)


def noses_down(rng: np.random.Generator) -> Array:
    """Down convex hillsides, ever steeper from each shoulder until a brook flattens the road for a moment
    (Gilbert, The Convexity of Hilltops, J. Geology 17, 1909)."""
    grade, at = np.empty(CELLS), 0
    while at < CELLS:
        cells = round(rng.uniform(350.0, 1500.0) / STEP_M)
        along = np.arange(cells) / cells
        nose = 0.024 + rng.uniform(0.038, 0.046) * along ** rng.uniform(0.5, 1.1)
        grade[at : at + cells] = -nose[: CELLS - at]
        at += cells
    return np.clip(_eased(grade, 11), -STEEPEST, -0.012)
