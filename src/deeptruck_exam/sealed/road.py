"""Humps against speeding, and slopes that earthworks have taken down."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Sizes, State, moving, weight
from deeptruck_exam.effects.places import CELL_M, CELLS, MAP_CELL_M, MAP_CELLS, OnRoad
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")


@law("x_humps_against_speeding", needs="suburban hills", name="road_surface", accepts="road_grade")
@sizes(loss=(0.03, 0.055), apart_m=(45.0, 90.0), series=(4.0, 9.0), rests_m=(200.0, 700.0), best=(6.0, 9.0))
@sizes(swings_s=(0.6, 1.5))
class HumpsAgainstSpeeding(OnRoad, swings=0.0):
    """Series of humps. Slow trucks climb them and get most of it back; at a middle speed springs and dampers
    take most; faster ones are thrown less for each metre. A truck that still `swings` from the last hump
    loses more on the next. loss: of the weight, on a hump; best: m/s that cost most.
    Source: Watts, Road Humps for the Control of Vehicle Speeds, TRRL Report LR 597 (1973): profile, spacing
    and discomfort over speed; series and sizes are chosen here."""

    def prepare(self) -> None:
        rng, p = self.rng(1361), self.p
        self.road = np.zeros((self.rows(), CELLS))
        for row in self.road:
            at = rng.uniform(0.0, p.rests_m)
            while at < CELL_M * (CELLS - 8):
                for _ in range(int(rng.integers(3, int(p.series) + 3))):
                    cell = min(int(at / CELL_M), CELLS - 8)
                    row[cell : cell + 5] = np.maximum(row[cell : cell + 5], [0.5, 1.0, 0.8, 1.0, 0.5])
                    at += p.apart_m * rng.uniform(0.85, 1.15)
                at += p.rests_m * rng.uniform(0.4, 1.6)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        on = self.read(self.road, view)
        ratio = np.maximum(view.speed, 0.1) / p.best
        costs = 0.2 + 1.6 * ratio / (1.0 + ratio**2)
        wants = on * costs
        s.swings = s.swings + dt * (wants - s.swings) / np.where(wants > s.swings, 0.15, p.swings_s)
        return -p.loss * (0.6 * s.swings + 0.5 * on * s.swings) * weight(view) * moving(view)


@law(
    "x_slopes_were_taken_down",
    needs="hills descent",
    name="road_grade",
    accepts="road_surface",
    gateable=False,
)
@sizes(share=(0.3, 0.55), mean_m=(500.0, 1400.0), built=(0.4, 0.6), eases_m=(30.0, 90.0), tips=(0.002, 0.006))
class SlopesWereTakenDown(OnRoad):
    """Stretches were rebuilt since the map was made: cuttings and embankments took a share of each slope, and
    what was dug is spread at their ends, where the road is a little steeper than mapped. share: of the slope;
    built: of the road; tips: slope of the ends.
    Source: AASHTO, A Policy on Geometric Design of Highways and Streets (2018), chapter 3, on reducing
    grades, and Hickerson, Route Location and Design (1964), on balance of cut and fill; stretches are chosen
    here."""

    conceal = ("elevation",)

    def prepare(self) -> None:
        rng, p = self.rng(1362), self.p
        wide = max(3, round(p.eases_m / MAP_CELL_M))
        ease = np.hanning(wide + 2) / np.hanning(wide + 2).sum()
        rough = np.zeros((self.rows(), MAP_CELLS))
        for row in rough:
            at = 0
            while at < MAP_CELLS:
                cells = max(4, round(p.mean_m * rng.uniform(0.5, 1.5) / MAP_CELL_M))
                row[at : at + cells] = (rng.random() < p.built) * rng.uniform(0.7, 1.2)
                at += cells
        self.road = np.array([np.convolve(row, ease, mode="same") for row in rough])
        self.ends = (
            p.tips * np.gradient(self.road, axis=1) / max(float(np.abs(np.diff(self.road)).max()), 1e-6)
        )

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        taken = np.clip(p.share * self.between(self.road, view), 0.0, 0.7) * view.grade
        tips = self.setting.direction * self.between(self.ends, view)
        return np.asarray((taken - tips) * weight(view) * moving(view))
