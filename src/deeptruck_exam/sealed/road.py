"""Slopes that were surveyed in one direction, and a soft shoulder where one gives way."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, eased, moving, weight
from deeptruck_exam.effects.places import OnRoad, windows
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_exam.effects.series import spells, within
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")


@law("q_surveyed_one_way", needs="hills descent", name="road_grade", gateable=False)
@sizes(late_m=(45.0, 90.0), gain=(0.8, 1.2))
class SurveyedOneWay(Hidden, lagging=-9.0):
    """`lagging`: slope as a filter follows it along the way. The map comes from one survey drive whose slopes
    were filtered as they came, so each lies too far along that way. Who drives the same way meets hills
    earlier than the map says, who drives the other way later. late_m: of the filter.
    Source: Oppenheim and Schafer, Discrete-Time Signal Processing (2010), on the delay of causal filters, and
    Sahlholm and Johansson, Road Grade Estimation for Look-ahead Vehicle Control, Control Engineering Practice
    18 (2010), on slopes that are recorded along drives; sizes are chosen here."""

    conceal = ("elevation",)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.lagging = np.where(s.lagging < -5.0, view.grade, s.lagging)
        s.lagging = eased(s.lagging, view.grade, p.late_m / np.maximum(view.speed, 0.05), dt)
        slope = self.setting.direction * p.gain * (view.grade - s.lagging)
        return -np.clip(slope, -0.06, 0.06) * weight(view) * moving(view)


@law(
    "q_gives_way_onto_the_shoulder", needs="suburban hills", name="road_surface", accepts="rolling_resistance"
)
@sizes(
    most=(0.028, 0.048), aside_s=(3.0, 8.0), between_s=(12.0, 40.0), soft=(0.5, 0.75), mean_m=(200.0, 800.0)
)
@sizes(sinks_mps=(6.0, 15.0))
class GivesWayOntoTheShoulder(OnRoad, aside=0.0):
    """On a narrow road the right wheels run on the shoulder while somebody comes the other way. Some
    shoulders are paved or dry; soft ones hold the wheels back, and the more, the slower they roll, for then
    they sink. most: of the weight; soft: of the road; sinks_mps: where sinking is a third of the most.
    Source: Wong, Theory of Ground Vehicles (2008), on motion resistance by sinkage and on its rate, and
    AASHTO, Guidelines for Geometric Design of Low-Volume Roads, on meeting there; sizes are chosen here."""

    def prepare(self) -> None:
        rng, p = self.rng(1561), self.p
        self.road = windows(rng, self.rows(), p.mean_m, p.soft)
        on, off = (0.6 * p.aside_s, 1.4 * p.aside_s), (0.5 * p.between_s, 1.5 * p.between_s)
        self.meets = spells(rng, self.setting.batch, on, off)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.aside = eased(s.aside, within(self.meets, view.time), 0.8, dt)
        sinks = 0.4 + 0.6 * np.exp(-np.maximum(view.speed, 0.0) / p.sinks_mps)
        soft = 0.05 + 0.95 * self.between(self.road, view)
        return -p.most * s.aside * soft * sinks * weight(view) * moving(view)
