"""Wet plates over trenches, a tread that grows round, and a net of filler in the rubber."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, eased, moving, weight
from deeptruck_exam.effects.places import OnRoad, windows
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_exam.effects.series import spells, within
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")


@law("h_plates_over_the_trenches", needs="suburban hills", name="wheel_slip")
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


@law(
    "h_tread_grows_round",
    needs="highway hills suburban",
    name="rolling_resistance_speed",
    accepts="drag_area rolling_resistance",
)
@sizes(at_20=(0.006, 0.011), power=(1.2, 2.0), grows_s=(3.0, 9.0), shrinks_s=(12.0, 40.0), flat=(0.3, 0.7))
class TreadGrowsRound(Hidden, round=0.0):
    """`round`: of the tread of soft cross-ply tyres, which grows with the square of speed, and of which the
    cords keep a part for a while. A round tread scrubs over its shoulders at each turn; heavy loads press it
    flat. at_20: of the weight, at 20 m/s for long; flat: power of the mass.
    Source: Clark, Mechanics of Pneumatic Tires, NHTSA (1981), on growth and its creep in cords, and Wong,
    Theory of Ground Vehicles (2008), on cross-ply tyres; large growth, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        wish = np.clip(view.speed / 20.0, 0.0, 1.5) ** 2
        s.round = eased(s.round, wish, np.where(wish > s.round, p.grows_s, p.shrinks_s), dt)
        light = (20000.0 / np.maximum(view.mass, 8000.0)) ** p.flat
        return -p.at_20 * np.minimum(s.round**p.power * light, 2.5) * weight(view) * moving(view)


@law("h_filler_net_breaks", name="rolling_resistance_warmup")
@sizes(most=(0.0065, 0.011), way_m=(500.0, 1500.0), whole_s=(40.0, 120.0), harsh=(0.5, 1.5), power=(1.0, 1.6))
class FillerNetBreaks(Hidden):
    """`net` of filler in the rubber, whole after a night, that makes it stiff. Each turn of the wheel breaks
    some of it, and pulls and brakings more; at a stand or a crawl it grows again. Heat has no part in it.
    most: of the weight, with a whole net; way_m: until two thirds are broken; whole_s: until it is whole.
    Source: Payne, The Dynamic Properties of Carbon Black-Loaded Natural Rubber, J. Applied Polymer Science 6
    (1962), on nets of filler that strain breaks and rest mends; quick mending, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"net": self.rng(1973).uniform(0.5, 1.0, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        strain = 1.0 + p.harsh * np.minimum(np.abs(view.acceleration), 2.0)
        mends = (1.0 - s.net) / p.whole_s * np.exp(-speed / 4.0)
        s.net = np.clip(s.net + dt * (mends - strain * speed / p.way_m * (s.net - 0.1)), 0.0, 1.0)
        return -p.most * s.net**p.power * weight(view) * moving(view)
