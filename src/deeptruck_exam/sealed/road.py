"""Ruts whose sides are climbed, and ramps that follow the tide."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Sizes, State, index, moving, weight
from deeptruck_exam.effects.places import MAP_CELL_M, MAP_CELLS, OnRoad, smooth_stretches
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_exam.effects.series import ou_series
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")


@law("k_ruts_are_climbed", needs="suburban hills highway descent", name="road_surface", accepts="road_grade")
@sizes(most=(0.016, 0.03), apart_m=(150.0, 600.0), wanders_s=(2.0, 6.0), free=(0.2, 0.5))
class RutsAreClimbed(OnRoad):
    """Wheels that wander climb the sides of deep ruts and are pressed back by them: tyres then roll across
    their heading. In the middle of a rut nothing is lost. most: of the weight, in the deepest ruts; free: of
    the usual wander, that has room.
    Source: Pacejka, Tire and Vehicle Dynamics (2012), on side force by slip and camber, a rut's side taken as
    a slope, and Cebon, Handbook of Vehicle-Road Interaction (1999), on ruts; sizes are chosen here."""

    def prepare(self) -> None:
        rng, p = self.rng(1461), self.p
        self.road = smooth_stretches(rng, self.rows(), (0.4 * p.apart_m, 1.6 * p.apart_m), (300.0, 1500.0))
        shape = (self.setting.batch, int(self.setting.duration_s / 0.1) + 20)
        self.aside = np.abs(ou_series(rng, shape, 0.1, p.wanders_s))

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        aside = self.aside[:, index(view, self.aside, 0.1)]
        climbs = np.clip(aside - p.free, 0.0, 2.0) ** 1.2
        return -p.most * self.read(self.road, view) * climbs * weight(view) * moving(view)


@law(
    "k_ramps_follow_the_tide",
    needs="hills highway suburban",
    name="road_grade",
    accepts="road_surface",
    gateable=False,
)
@sizes(rises_m=(2.0, 4.0), ramp_m=(80.0, 160.0), long_m=(150.0, 500.0), apart_m=(600.0, 1600.0))
class RampsFollowTheTide(OnRoad):
    """Floating bridges, which the map has as they lie at half tide: at high water a ramp leads up to each and
    another one down behind it, at low water it is the other way round. Each drive has its own hour. rises_m:
    of the highest water over the middle one; ramp_m: of each ramp.
    Source: Watanabe and Utsunomiya, Analysis and Design of Floating Bridges, Progress in Structural
    Engineering and Materials 5 (2003), on transition spans over tides; bridges and sizes are chosen
    here."""

    conceal = ("elevation",)

    def prepare(self) -> None:
        rng, p = self.rng(1462), self.p
        height = np.zeros((self.rows(), MAP_CELLS))
        metres = np.arange(MAP_CELLS) * MAP_CELL_M
        for row in height:
            at = rng.uniform(0.0, p.apart_m)
            while at < metres[-1]:
                ramp, long = p.ramp_m * rng.uniform(0.8, 1.2), p.long_m * rng.uniform(0.6, 1.4)
                up = np.clip((metres - at) / ramp, 0.0, 1.0)
                down = np.clip((metres - at - ramp - long) / ramp, 0.0, 1.0)
                row += up - down
                at += 2.0 * ramp + long + p.apart_m * rng.uniform(0.5, 1.5)
        ease = np.hanning(7) / np.hanning(7).sum()
        self.road = np.array([np.convolve(np.gradient(row, MAP_CELL_M), ease, mode="same") for row in height])

    def start(self, batch: int) -> dict[str, Array]:
        hour = 2.0 * np.pi * self.rng(1463).random(batch)
        return {"tide": np.sign(np.sin(hour)) * np.sqrt(np.abs(np.sin(hour)))}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        slope = self.setting.direction * p.rises_m * s.tide * self.between(self.road, view)
        return -slope * weight(view) * moving(view)
