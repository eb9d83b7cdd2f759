"""Sand on the road, and a road on thawing ground."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Sizes, State, moving, weight
from deeptruck_exam.effects.places import (
    CELL_M,
    CELLS,
    MAP_CELL_M,
    MAP_CELLS,
    OnRoad,
    smooth_stretches,
    stretches,
)
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")


@law("t_dunes_creep_over", name="road_surface", accepts="road_grade")
@sizes(resists=(0.014, 0.032), dune_m=(40.0, 130.0), apart_m=(60.0, 260.0), ploughs=(0.3, 0.9))
class DunesCreepOver(OnRoad):
    """`deep` (routes, cells): sand that thickens slowly to a crest and ends steeply. Rear axles follow in the
    ruts. resists: of the weight, at the crest; ploughs: more of it, at 15 m/s.
    Source: Bagnold, The Physics of Blown Sand and Desert Dunes (1941), on barchans, and Wong, Theory of
    Ground Vehicles (2008), on compaction and bulldozing resistance in sand; sizes are chosen here."""

    wheelbase_m = 6.0

    def prepare(self) -> None:
        rng, p = self.rng(988), self.p
        self.deep = np.zeros((self.rows(), CELLS))
        gaps, lengths = (0.5 * p.apart_m, 1.5 * p.apart_m), (0.6 * p.dune_m, 1.6 * p.dune_m)
        for row in self.deep:
            for first, last in stretches(rng, gaps, lengths):
                along = (np.arange(last - first) + 0.5) / (last - first)
                dune = np.minimum((along / 0.75) ** 1.3, (1.0 - along) / 0.25)
                row[first:last] = rng.uniform(0.5, 1.0) * dune

    def sand(self, view: View, behind_m: float) -> Array:
        """Depth, between the middles of cells."""
        at = (self.place(view) - self.setting.direction * behind_m) / CELL_M
        low, route = at.astype(int), self.setting.route
        share = at - np.floor(at)
        ends = (self.deep[route, low % CELLS], self.deep[route, (low + 1) % CELLS])
        return np.asarray((1.0 - share) * ends[0] + share * ends[1])

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        deep = 0.6 * self.sand(view, 0.0) + 0.4 * self.sand(view, self.wheelbase_m)
        faster = 1.0 + p.ploughs * np.clip(view.speed / 15.0, 0.0, 2.0) ** 2
        return -p.resists * deep * faster / (1.0 + p.ploughs) * weight(view) * moving(view)


@law(
    "t_road_on_thawing_ground",
    needs="hills highway suburban",
    name="road_grade",
    accepts="road_surface",
    gateable=False,
)
@sizes(slope=(0.014, 0.026), shortest_m=(70.0, 140.0), longest=(2.0, 4.0), apart_m=(80.0, 400.0))
class RoadOnThawingGround(OnRoad):
    """Waves of many lengths where ice has melted out of the ground since the survey. slope: standard
    deviation in the middle of a stretch; longest: over the shortest.
    Source: Andersland and Ladanyi, Frozen Ground Engineering (2004), on thaw settlement under roads, uneven
    as the ice in the ground is; lengths and slopes are chosen here."""

    conceal = ("elevation",)

    def prepare(self) -> None:
        rng, p, rows = self.rng(989), self.p, self.rows()
        at_m = np.arange(MAP_CELLS) * MAP_CELL_M
        waves_m = p.shortest_m * p.longest ** rng.random((rows, 12, 1))
        phase = rng.uniform(0.0, 2.0 * np.pi, waves_m.shape)
        waves = np.sin(2.0 * np.pi * at_m / waves_m + phase).sum(axis=1) / np.sqrt(6.0)
        thaws = smooth_stretches(rng, rows, (0.5 * p.apart_m, 1.5 * p.apart_m), (400.0, 1600.0))
        self.road = np.clip(p.slope * waves * np.sqrt(thaws[:, ::2]), -0.055, 0.055)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        slope = self.setting.direction * self.between(self.road, view)
        return -slope * weight(view) * moving(view)
