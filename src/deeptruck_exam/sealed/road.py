"""A mat over a bog, and a lane beside the axis of its road."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Sizes, State, moving, weight
from deeptruck_exam.effects.places import CELLS, MAP_CELL_M, MAP_CELLS, OnRoad, stretches
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")


@law("e_mat_over_the_bog", name="road_surface", accepts="road_grade")
@sizes(
    whole=(0.004, 0.009), torn=(0.016, 0.032), bears=(0.02, 0.045), sinks_m=(4.0, 15.0), out_m=(25.0, 90.0)
)
class MatOverTheBog(OnRoad, sunk=0.0):
    """A mat of roots bears the truck until its wheels shear it, by pull or brake; then they are in the peat,
    and come out over the way. whole, torn: of the weight; bears: shear over weight, more in some places than
    in others.
    Source: Wong, Radforth and Preston-Thomas, Some Further Studies on the Mechanical Properties of Muskeg in
    Relation to Vehicle Mobility, J. Terramechanics 19 (1982); stretches and sizes are chosen here."""

    def prepare(self) -> None:
        rng = self.rng(1061)
        self.soft = np.zeros((self.rows(), CELLS))
        self.bears = np.full((self.rows(), CELLS), 1e3)
        for soft, bears in zip(self.soft, self.bears, strict=True):
            for first, last in stretches(rng, (60.0, 450.0), (90.0, 500.0)):
                soft[first:last] = 1.0
                bears[first:last] = self.p.bears * rng.lognormal(0.0, 0.35)

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "on": np.zeros(batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        way = dt * np.maximum(view.speed, 0.0)
        s.on = s.on + way * (self.read(self.soft, view) - s.on) / 6.0
        shear = np.maximum(np.abs(view.traction_force), view.brake_force) / weight(view)
        tears = np.clip((shear / self.read(self.bears, view) - 1.0) / 0.2, 0.0, 1.0)
        s.sunk = np.clip(s.sunk + way * (tears * (1.0 - s.sunk) / p.sinks_m - s.sunk / p.out_m), 0.0, 1.0)
        resists = p.whole + (p.torn - p.whole) * s.sunk
        return -resists * s.on * weight(view) * moving(view)


@law(
    "e_lane_beside_the_axis",
    needs="hills highway suburban",
    name="road_grade",
    accepts="road_surface",
    gateable=False,
)
@sizes(banks=(0.06, 0.09), aside_m=(8.0, 14.0), runoff_m=(40.0, 75.0), straight_m=(30.0, 120.0))
class LaneBesideTheAxis(OnRoad):
    """The map has the axis of the road; the lane lies aside of it, and climbs and falls where the road is
    banked for a bend. Who comes the other way has the other side, and meets the same slope. banks: slope
    across, in the tightest.
    Source: AASHTO, A Policy on Geometric Design of Highways and Streets (2018), on superelevation runoff and
    relative gradients of lanes far from the axis of rotation; widths and bends are chosen here."""

    conceal = ("elevation",)

    def prepare(self) -> None:
        rng, p = self.rng(1062), self.p
        self.road = np.zeros((self.rows(), MAP_CELLS))
        ramp = np.hanning(round(2.0 * p.runoff_m / MAP_CELL_M) + 3)
        for row in self.road:
            bank, side = np.zeros(CELLS), rng.choice([-1.0, 1.0])
            for first, last in stretches(rng, (p.straight_m, 3.0 * p.straight_m), (90.0, 350.0)):
                side *= rng.choice([-1.0, -1.0, 1.0])
                bank[first:last] = side * p.banks * rng.uniform(0.5, 1.0)
            eased = np.convolve(bank[: 2 * MAP_CELLS : 2], ramp / ramp.sum(), mode="same")
            row[:] = np.clip(np.gradient(p.aside_m * eased, MAP_CELL_M), -0.03, 0.03)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        return -self.between(self.road, view) * weight(view) * moving(view)
