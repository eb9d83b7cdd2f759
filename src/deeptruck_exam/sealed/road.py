"""A map that saw the tree tops, water in the sags, and a road up a stream."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Sizes, State, eased, moving, weight
from deeptruck_exam.effects.places import MAP_CELL_M, OnRoad, windows
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_exam.effects.series import ou_series, spells, within
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")


@law("y_map_saw_the_tree_tops", needs="hills descent", name="road_grade", gateable=False)
@sizes(
    high_m=(3.5, 6.5), uneven=(0.15, 0.3), mean_m=(300.0, 900.0), share=(0.35, 0.6), pixel_m=(180.0, 320.0)
)
class MapSawTheTreeTops(OnRoad):
    """The slopes known are those of a radar's map from space, which took the tops of woods for ground. At the
    edge of a wood the map climbs, where the road does not; inside, it follows unequal trees. high_m: of a
    wood, as the radar saw it; uneven: of that; mean_m: of a wood; pixel_m: over which the map is a mean.
    Source: Farr and others, The Shuttle Radar Topography Mission, Reviews of Geophysics 45 (2007), on heights
    of canopies in the map; sizes are chosen here."""

    conceal = ("elevation",)

    def prepare(self) -> None:
        rng, p = self.rng(1861), self.p
        woods = windows(rng, self.rows(), p.mean_m, p.share)
        trees = 1.0 + p.uneven * ou_series(rng, woods.shape, MAP_CELL_M, 120.0)
        cells = 2 * round(p.pixel_m / MAP_CELL_M) + 1
        ease = np.hanning(cells) / np.hanning(cells).sum()
        tops = np.array([np.convolve(row, ease, mode="same") for row in p.high_m * woods * trees])
        self.road = np.gradient(tops, MAP_CELL_M, axis=1)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        climbs = np.clip(self.setting.direction * self.between(self.road, view), -0.05, 0.05)
        return climbs * weight(view) * moving(view)  # the map has it, the road has not


@law("y_water_in_the_sags", needs="suburban hills highway", name="road_surface", accepts="road_grade")
@sizes(most=(0.007, 0.012), sag=(0.00003, 0.00007), long_m=(60.0, 140.0), rains_s=(15.0, 45.0))
@sizes(runs_off_s=(10.0, 30.0), power=(0.8, 1.5))
class WaterInTheSags(OnRoad, behind=0.0, wet=0.5):
    """Rain gathers where the road has been going down and begins to climb: in its sags, by their curvature.
    On crests and even slopes it runs off. `behind`: slope of the way before, by which a sag is told. `wet`:
    the land, which rains fill and which runs dry. most: of the weight, at 12 m/s; sag: 1/m, of deep water.
    Source: AASHTO, A Policy on Geometric Design of Highways and Streets (2018), on drainage of sag curves,
    and Wong, Theory of Ground Vehicles (2008), on water that wheels push; sizes are chosen here."""

    def prepare(self) -> None:
        p, batch = self.p, self.setting.batch
        on, off = (0.6 * p.rains_s, 1.8 * p.rains_s), (0.3 * p.rains_s, 1.2 * p.rains_s)
        self.rain = spells(self.rng(1862), batch, on, off)

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "new": np.ones(batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        s.behind = np.where(s.new > 0.5, view.grade, s.behind)
        s.new = np.zeros_like(s.new)
        bends = (view.grade - s.behind) / p.long_m
        s.behind = eased(s.behind, view.grade, p.long_m / np.maximum(speed, 1e-3), dt)
        s.wet = eased(s.wet, within(self.rain, view.time), p.runs_off_s, dt)
        level = np.exp(-((view.grade / 0.03) ** 2))
        deep = s.wet * np.clip(bends / p.sag + 0.35 * level, 0.0, 1.3)
        return -p.most * deep * np.minimum(speed / 12.0, 1.8) ** p.power * weight(view) * moving(view)


@law("y_road_up_a_stream", needs="suburban hills highway", name="unknown")
@sizes(
    holds=(0.0035, 0.006), flows_mps=(2.0, 4.5), mean_m=(200.0, 600.0), share=(0.35, 0.6), swells=(0.2, 0.5)
)
@sizes(swells_m=(60.0, 200.0))
class RoadUpAStream(OnRoad):
    """Over stretches the road is the bed of a stream that flows along it. Water resists by the square of the
    pace through it, so upstream costs much, and downstream it first helps and then costs less. It is deeper
    in some places. holds: of the weight, at 10 m/s through the water; swells: of the depth.
    Source: Hoerner, Fluid-Dynamic Drag (1965), on bodies that stand in a stream, and Chow, Open-Channel
    Hydraulics (1959), on flows by slope; sizes are chosen here."""

    def prepare(self) -> None:
        rng, p = self.rng(1863), self.p
        water = windows(rng, self.rows(), p.mean_m, p.share)
        deep = 1.0 + p.swells * ou_series(rng, water.shape, MAP_CELL_M, p.swells_m)
        self.road = water * np.clip(deep, 0.2, 2.0)
        ease = np.hanning(7) / np.hanning(7).sum()
        self.road = np.array([np.convolve(row, ease, mode="same") for row in self.road])
        self.flow = (rng.choice([-1.0, 1.0], self.rows()) * p.flows_mps)[self.setting.route]

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        through = np.maximum(view.speed, 0.0) - self.setting.direction * self.flow
        pushed = np.clip(through * np.abs(through) / 100.0, -1.5, 2.5)
        return -p.holds * self.between(self.road, view) * pushed * weight(view) * moving(view)
