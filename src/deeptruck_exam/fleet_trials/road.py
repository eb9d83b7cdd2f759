"""Fifth forms of the road: washboard of gravel roads, and slopes inside outages of satellite reception."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from deeptruck_exam.hidden import GRAVITY, Array, Hidden, hidden, moving, place, weight
from deeptruck_model.trucks import View

CELL_M = 5.0
CELLS = 12400  # a little more than the longest road


class ByPlace(Hidden):
    """Rows (routes, cells) read at the truck's place, whichever way it drives."""

    def rows(self) -> int:
        return int(self.setting.route.max()) + 1

    def cell(self, view: View) -> NDArray[np.int64]:
        return (place(self.setting, view) / CELL_M).astype(int) % CELLS

    def read(self, rows: Array, view: View) -> Array:
        return np.asarray(rows[self.setting.route, self.cell(view)])


def stretches(
    rng: np.random.Generator, gaps: tuple[float, float], lengths: tuple[float, float]
) -> list[tuple[int, int]]:
    """First and last cell of stretches along one road; gaps and lengths are log-uniform, m."""
    out, at = [], rng.uniform(0.0, gaps[1])
    while at < CELL_M * CELLS:
        end = at + np.exp(rng.uniform(*np.log(lengths)))
        out.append((int(at / CELL_M), min(int(end / CELL_M) + 1, CELLS)))
        at = end + np.exp(rng.uniform(*np.log(gaps)))
    return out


@hidden(
    "washboard",
    name="road_surface",
    forms="fifth",
    source="Corrugations of unsealed roads, 0.5-1.2 m long (Mather, Civil Eng. Public Works Rev., 1963;"
    " Bitbol, Taberlet, Morris and McElwaine, Phys. Rev. E 79, 2009): wheels hop in resonance at a speed"
    " that the length sets, and skip over the crests above it; lengths and sizes are chosen here",
    ranges={
        "peak": (0.010, 0.022),  # of the weight
        "hop_hz": (9.0, 12.5),
        "damping": (0.15, 0.35),
        "covers": (0.4, 0.7),
    },
    accepts=("road_grade",),
)
class Washboard(ByPlace):
    """Crawling costs little, and driving fast less than driving at the speed of the wheels' hop."""

    def prepare(self) -> None:
        rng, p = self.setting.rng(411), self.p
        self.depth = np.zeros((self.rows(), CELLS))
        self.length = np.ones((self.rows(), CELLS))
        gaps = (80.0, 500.0 * (1.0 - p.covers) / p.covers)
        for depth, length in zip(self.depth, self.length, strict=True):
            for first, last in stretches(rng, gaps, (90.0, 600.0)):
                depth[first:last] = rng.uniform(0.5, 1.0)
                length[first:last] = rng.uniform(0.55, 1.5)

    def newtons(self, view: View, dt: float) -> Array:
        p = self.p
        turns = np.maximum(view.speed, 0.0) / self.read(self.length, view) / p.hop_hz
        broad = (2.0 * p.damping * turns) ** 2
        shaken = broad / ((1.0 - turns**2) ** 2 + broad + 1e-9)
        return -p.peak * self.read(self.depth, view) * (0.25 + 0.75 * shaken) * weight(view) * moving(view)


@hidden(
    "chippings",
    name="road_surface",
    forms="fifth",
    source="Surface dressing: loose chippings are rolled into the binder by traffic, pass by pass, and drag"
    " until then (TRL Road Note 39, Design Guide for Road Surface Dressing); a wheel pushes a wave of them"
    " from a speed on (Wong, Theory of Ground Vehicles, on bulldozing); sizes are chosen here",
    ranges={
        "drags": (0.010, 0.024),
        "passes": (1.5, 5.0),
        "pushes_mps": (7.0, 16.0),
        "site_m": (250.0, 700.0),
    },
    accepts=("road_grade",),
)
class Chippings(ByPlace):
    """Later drives find less of it."""

    def prepare(self) -> None:
        rng, batch = self.setting.rng(412), self.setting.batch
        self.loose = np.zeros((self.rows(), CELLS))
        for row in self.loose:
            for first, last in stretches(rng, (150.0, 600.0), (0.6 * self.p.site_m, 2.0 * self.p.site_m)):
                fresh = rng.uniform(0.6, 1.0)
                row[first:last] = fresh * rng.uniform(0.6, 1.3, last - first)
        order = rng.permutation(batch)
        self.left = np.exp(-order * 0.5 / self.p.passes)

    def newtons(self, view: View, dt: float) -> Array:
        lies = self.read(self.loose, view) * self.left
        speed = np.maximum(view.speed, 0.0)
        wave = 0.55 + 0.45 * np.tanh(speed / self.p.pushes_mps) ** 2
        return -self.p.drags * lies * wave * weight(view) * moving(view)


@hidden(
    "grade_held_in_outages",
    name="road_grade",
    forms="fifth",
    gateable=False,
    source="Slope from satellite heights is frozen where reception fails (cuttings, woods, bridges: Groves,"
    " Principles of GNSS, Inertial and Multisensor Navigation Systems, 2013), while the road goes on to rise"
    " or fall: the error is nothing at the way in and all at the way out; lengths and sizes chosen here",
    ranges={"slope": (0.016, 0.032), "outage_m": (250.0, 650.0), "between_m": (120.0, 420.0)},
    needs=("hills", "highway", "suburban"),
    accepts=("road_surface",),
)
class GradeHeldInOutages(ByPlace):
    """`road` (2, routes, cells): driven forwards and backwards, for the way in is at another end."""

    conceal = ("elevation",)

    def prepare(self) -> None:
        rng, p = self.setting.rng(413), self.p
        self.road = np.zeros((2, self.rows(), CELLS))
        for k in range(self.rows()):
            gaps = (0.5 * p.between_m, 1.5 * p.between_m)
            for first, last in stretches(rng, gaps, (0.6 * p.outage_m, 1.7 * p.outage_m)):
                m = last - first
                way = np.linspace(0.0, 1.0, m)
                bend = rng.uniform(0.5, 1.0) * rng.choice([-1.0, 1.0]) * 0.5 * (1.0 - np.cos(np.pi * way))
                swing = 0.6 * rng.uniform(-1.0, 1.0) * np.sin(2.0 * np.pi * way)
                walk = p.slope * (bend + swing)
                self.road[0, k, first:last] = walk
                self.road[1, k, first:last] = walk - walk[-1]

    def newtons(self, view: View, dt: float) -> Array:
        way = (self.setting.direction < 0).astype(int)
        slope = self.setting.direction * self.road[way, self.setting.route, self.cell(view)]
        return -slope * view.mass * GRAVITY * moving(view)
