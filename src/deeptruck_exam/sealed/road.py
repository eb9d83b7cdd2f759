"""Clay that heaves in rows, and dust in holes."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Sizes, State, eased, moving, weight
from deeptruck_exam.effects.places import CELL_M, CELLS, OnRoad, smooth_stretches
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_exam.effects.series import ou_series
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")


@law("j_clay_heaves_in_rows", needs="hills highway suburban", name="road_grade", gateable=False)
@sizes(tilts=(0.012, 0.02), row_m=(110.0, 230.0), uneven=(0.1, 0.25), patch_m=(500.0, 1500.0))
class ClayHeavesInRows(OnRoad):
    """Since the survey the clay under the road has taken up water and heaved in rows of rounded mounds and
    sharp hollows, of nearly one length, in some patches much and in others not. tilts: of the steepest, in a
    wet patch; row_m: from hollow to hollow; uneven: of that; patch_m: how far wet and dry are apart.
    Source: Paton, Origin and Terminology for Gilgai in Australia, Geoderma 11 (1974), on mounds and hollows
    of swelling clay; long rows that a road would show, sizes are chosen here."""

    conceal = ("elevation",)

    def prepare(self) -> None:
        rng, p, rows = self.rng(2261), self.p, self.rows()
        row = p.row_m * np.exp(p.uneven * ou_series(rng, (rows, CELLS), CELL_M, 2.0 * p.row_m))
        phase = np.cumsum(np.pi * CELL_M / row, axis=1) + rng.uniform(0.0, np.pi, (rows, 1))
        wet = np.clip(0.7 + 0.9 * ou_series(rng, (rows, CELLS), CELL_M, p.patch_m), 0.0, 1.7)
        side = np.cos(phase) * np.tanh(6.0 * np.sin(phase))  # of a mound |sin|
        ease = np.hanning(9) / np.hanning(9).sum()
        self.road = np.stack([np.convolve(r, ease, mode="same") for r in wet * side])

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        at = self.place(view) / CELL_M
        low, share, route = at.astype(int) % (CELLS - 1), at - np.floor(at), self.setting.route
        leans = (1.0 - share) * self.road[route, low] + share * self.road[route, low + 1]
        slope = np.clip(self.setting.direction * p.tilts * leans, -0.06, 0.06)
        return -slope * weight(view) * moving(view)


@law("j_dust_lies_in_holes", needs="suburban hills highway", name="road_surface", accepts="road_grade")
@sizes(most=(0.019, 0.03), flows_mps=(4.0, 7.0), floor=(0.2, 0.4), throws=(0.25, 0.5), sinks_m=(3.0, 8.0))
@sizes(mean_m=(60.0, 200.0))
class DustLiesInHoles(OnRoad, sunk=0.0):
    """Fine dust fills holes of the road to the brim. A slow wheel sinks to the floor and pushes through; a
    faster one leaves the air in the dust no time to escape, so that it carries like a fluid; a fast one
    throws it up. The drag is least between. `sunk`: of the depth, over some way. most: of the weight, slow;
    flows_mps: where half of it is gone; floor: that never goes; throws: of it, at 20 m/s.
    Source: Wong, Theory of Ground Vehicles (2008), on sinkage, and Bagnold, The Physics of Blown Sand and
    Desert Dunes (1941), on dust and the air in it; sizes are chosen here."""

    def prepare(self) -> None:
        gaps, lengths = (0.3 * self.p.mean_m, 1.2 * self.p.mean_m), (0.5 * self.p.mean_m, 2.5 * self.p.mean_m)
        self.road = smooth_stretches(self.rng(2262), self.rows(), gaps, lengths)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        deep = self.read(self.road, view) ** 0.7
        s.sunk = eased(s.sunk, deep, p.sinks_m / np.maximum(speed, 0.3), dt)
        flows = p.floor + (1.0 - p.floor) / (1.0 + (speed / p.flows_mps) ** 2)
        cost = flows + p.throws * np.minimum(speed / 20.0, 1.4) ** 2
        return -p.most * cost * s.sunk * weight(view) * moving(view)
