"""Road: unrecorded slopes, and surface."""

from __future__ import annotations

import numpy as np

from deeptruck_core.arrays import Array
from deeptruck_exam.laws.catalogue import Planted, law, sizes
from deeptruck_exam.laws.law import Setting, Sizes, State, moving, weight
from deeptruck_exam.laws.series import CELL_M, CELLS, OnRoad, smooth_spans
from deeptruck_model.trucks import View


@law("road_grade", "hills highway", accepts="road_surface", gateable=False)
def slope_not_recorded(setting: Setting, p: Sizes) -> Planted:
    """The road has slopes that are not recorded.
    Source: Newton's second law."""
    return Planted(withheld=("grade", "elevation"))


@law("road_grade", "hills highway suburban", accepts="road_surface", gateable=False)
@sizes(slope=(0.02, 0.045), gap_m=(250.0, 700.0))
class CoarseMap(OnRoad):
    """Local humps and dips that are missing in the recorded grade, which is from a map.
    Source: Rodriguez, Morris and Belz, A Global Assessment of the SRTM Performance, Photogramm. Eng. Remote
    Sens. 72 (2006), on errors of terrain models."""

    withheld = ("elevation",)

    def prepare(self) -> None:
        rng, p = self.rng(152), self.p
        humps = smooth_spans(rng, self.rows(), (p.gap_m, 2.0 * p.gap_m), (160.0, 420.0))
        slope = np.gradient(humps, axis=1)
        sign = rng.choice([-1.0, 1.0], (self.rows(), 1))
        self.road = p.slope * sign * slope / np.abs(slope).max()

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        slope = self.setting.direction * self.here(view)
        return -slope * weight(view) * moving(view)


@law("road_surface", accepts="road_grade")
@sizes(texture=(0.003, 0.010), roughness=(0.0001, 0.0004), share_of_road=(0.25, 0.5))
class RoughSpans(OnRoad):
    """Rough spans of 250 to 900 m, the same at all times and in both directions. roughness: per m/s above 5
    m/s.
    Source: Hammarström, Eriksson, Karlsson and Yahya, VTI rapport 748A (2012): rolling resistance with
    texture and, growing with speed, with roughness."""

    def prepare(self) -> None:
        rng = self.rng(4)
        length = CELL_M * CELLS
        self.road = np.zeros((self.rows(), CELLS))
        for row in self.road:
            at = 0.0
            while at < length:
                at += rng.uniform(250.0, 900.0) * (1.0 - self.p.share_of_road) / self.p.share_of_road
                end = at + rng.uniform(250.0, 900.0)
                row[int(at / CELL_M) : int(end / CELL_M)] = rng.uniform(0.6, 1.0)
                at = end

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        extra = p.texture + p.roughness * np.maximum(view.speed - 5.0, 0.0)
        return -self.here(view) * extra * weight(view) * moving(view)


@law("road_surface", accepts="road_grade")
@sizes(film=(0.35, 1.0), gap_m=(250.0, 600.0), pool_m=(150.0, 500.0), driest=(0.4, 0.9))
class StandingWater(OnRoad):
    """Pools on the road, with another depth each day. film: resistance at 15 m/s and full depth, in 10 N per
    kN of weight.
    Source: Gengenbach (1968), in Mitschke and Wallentowitz, Dynamik der Kraftfahrzeuge: splash resistance of
    a tyre with its width, water depth and the power 1.6 of speed."""

    def prepare(self) -> None:
        rng, p = self.rng(151), self.p
        self.road = smooth_spans(
            rng, self.rows(), (0.6 * p.gap_m, 1.6 * p.gap_m), (0.7 * p.pool_m, 1.8 * p.pool_m)
        )
        self.wet = rng.uniform(p.driest, 1.0, self.setting.batch)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        splash = 0.01 * (np.clip(view.speed, 0.0, 22.0) / 15.0) ** 1.6  # beyond it the tyres float
        return -p.film * self.wet * self.here(view) * splash * weight(view) * moving(view)
