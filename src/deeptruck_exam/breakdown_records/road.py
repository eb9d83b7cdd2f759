"""Sixth forms of the road: holes that wheels fall into, and carriageways that part."""

from __future__ import annotations

import numpy as np

from deeptruck_exam.fleet_trials.road import CELL_M, CELLS, ByPlace, stretches
from deeptruck_exam.hidden import GRAVITY, Array, hidden, moving, place, weight
from deeptruck_model.trucks import View

AXLES_M = np.array([0.0, 3.7, 5.1, 11.2, 12.5])[:, None]  # behind the front axle


@hidden(
    "holes_axle_by_axle",
    name="road_surface",
    forms="sixth",
    source="Settled trenches and holes after frost (Cebon, Handbook of Vehicle-Road Interaction, 1999, on"
    " short faults): a wheel falls freely while it is over one, so that slow wheels fall deeper, and what"
    " it has fallen is lost; axle after axle; depths and lengths of a neglected road are chosen here",
    ranges={
        "depth_m": (0.06, 0.14),
        "length_m": (1.2, 2.2),
        "holes": (1.2, 2.4),  # in 5 m of a bad stretch
        "covers": (0.35, 0.65),
    },
    accepts=("road_grade",),
)
class HolesAxleByAxle(ByPlace):
    """Whoever drives fast flies over them."""

    def prepare(self) -> None:
        rng, p = self.setting.rng(506), self.p
        self.depth = np.zeros((self.rows(), CELLS))
        gaps = (60.0, 420.0 * (1.0 - p.covers) / p.covers)
        for row in self.depth:
            for first, last in stretches(rng, gaps, (70.0, 420.0)):
                row[first:last] = p.depth_m * np.clip(rng.gamma(3.0, 0.33, last - first), 0.0, 1.8)

    def newtons(self, view: View, dt: float) -> Array:
        under = place(self.setting, view) - self.setting.direction * AXLES_M
        depth = self.depth[self.setting.route, (under / CELL_M).astype(int) % CELLS]
        over_s = self.p.length_m / np.maximum(view.speed, 2.0)
        falls = np.minimum(depth, 0.5 * GRAVITY * over_s**2)
        return -self.p.holes * falls.mean(axis=0) / CELL_M * weight(view) * moving(view)


@hidden(
    "carriageways_apart",
    name="road_grade",
    forms="sixth",
    gateable=False,
    source="Independent alignments of divided highways (AASHTO, A Policy on Geometric Design of Highways and"
    " Streets): in rolling land one carriageway lies metres above the other, while the map has a line between"
    " them, so that either way climbs where the other falls; heights and lengths are chosen here",
    ranges={"height_m": (5.0, 10.0), "length_m": (500.0, 1000.0), "between_m": (60.0, 350.0)},
    needs=("hills", "highway", "suburban"),
    accepts=("road_surface",),
)
class CarriagewaysApart(ByPlace):
    """`climbs` (routes, cells): what a truck meets beyond the map's slope, the same either way."""

    conceal = ("elevation",)

    def prepare(self) -> None:
        rng, p = self.setting.rng(507), self.p
        self.climbs = np.zeros((self.rows(), CELLS))
        gaps = (0.5 * p.between_m, 1.5 * p.between_m)
        for row in self.climbs:
            for first, last in stretches(rng, gaps, (0.7 * p.length_m, 1.4 * p.length_m)):
                m = last - first
                apart = rng.choice([-1.0, 1.0]) * p.height_m * rng.uniform(0.5, 1.0)
                # the height between them is a bell, wider on one side
                bell = np.sin(np.pi * np.linspace(0.0, 1.0, m + 1) ** rng.uniform(0.7, 1.4)) ** 2
                row[first:last] = np.clip(np.diff(apart * bell) / CELL_M, -0.055, 0.055)

    def newtons(self, view: View, dt: float) -> Array:
        return -self.read(self.climbs, view) * view.mass * GRAVITY * moving(view)
