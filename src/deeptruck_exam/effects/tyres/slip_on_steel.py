"""Wheels that slip on steel."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Sizes, State, eased, moving, weight
from deeptruck_exam.effects.places import OnRoad, windows
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_exam.effects.series import spells, within
from deeptruck_model.trucks import View

law = partial(hidden, name="wheel_slip")


@law("h_plates_over_the_trenches", "nineteenth", "suburban hills")
@sizes(grip=(0.1, 0.16), driven=(0.3, 0.45), mean_m=(40.0, 110.0), share=(0.22, 0.42), rains_s=(20.0, 60.0))
@sizes(slides=(0.2, 0.5))
class PlatesOverTheTrenches(OnRoad, lost=0.0, wet=0.5):
    """Works along a road have covered their trenches with plates of steel. `wet`: the plates, in showers.
    Driven wheels that pull harder than a wet plate lets them slide on it, and hold less while they do. grip:
    of a wet plate; driven: of the weight, on driven wheels; slides: of the grip, lost in sliding.
    Source: Wong, Theory of Ground Vehicles (2008), on grip by surface, and makers' notes on bare and
    coated plates for road works; worn plates, sizes are chosen here."""

    def prepare(self) -> None:
        rng, p = self.rng(1971), self.p
        self.road = windows(rng, self.rows(), p.mean_m, p.share)
        on, off = (0.7 * p.rains_s, 2.0 * p.rains_s), (0.3 * p.rains_s, p.rains_s)
        self.rain = spells(rng, self.setting.batch, on, off)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.wet = eased(s.wet, within(self.rain, view.time), 4.0, dt)
        pull = np.maximum(view.traction_force, 0.0)
        most = p.grip * (4.0 - 3.0 * s.wet) * p.driven * weight(view)
        over = np.maximum(pull / most - 1.0, 0.0)
        holds = most * (1.0 - p.slides * np.tanh(2.0 * over))
        s.lost = eased(s.lost, self.between(self.road, view) * np.maximum(pull - holds, 0.0), 0.15, dt)
        return -np.minimum(s.lost, pull) * moving(view)
