"""Road surfaces with water on them."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Sizes, State, eased, moving, weight
from deeptruck_exam.effects.places import OnRoad
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_exam.effects.series import spells, within
from deeptruck_model.trucks import View

law = partial(hidden, name="road_surface", accepts="road_grade")


@law("y_water_in_the_sags", "eighteenth", "suburban hills highway")
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
