"""Rolling resistance of treads, which changes with speed."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, eased, moving, weight
from deeptruck_exam.effects.places import OnRoad, windows
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, name="rolling_resistance_speed", accepts="drag_area rolling_resistance")


@law("h_tread_grows_round", "nineteenth", "highway hills suburban")
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


@law("b_rubber_sticks_to_the_road", "twentieth", "highway hills suburban")
@sizes(at_20=(0.011, 0.017), power=(0.5, 0.75), dust_m=(60.0, 160.0), cleans_m=(150.0, 500.0))
@sizes(mean_m=(400.0, 1200.0), share=(0.3, 0.5))
class RubberSticksToTheRoad(OnRoad):
    """Soft rubber sticks, and what it costs to peel it off grows with a root of the speed of peeling.
    `clean`: of the tread; dust of some stretches covers it, and clean road takes the dust off again. at_20:
    of the weight, at 20 m/s and quite clean; power: of the speed.
    Source: Barquins, Adherence and Rolling Kinetics of a Rigid Cylinder in Contact with a Natural Rubber
    Surface, J. Adhesion 26 (1988), on the power; very soft treads, sizes are chosen here."""

    def prepare(self) -> None:
        self.road = windows(self.rng(2072), self.rows(), self.p.mean_m, self.p.share)

    def start(self, batch: int) -> dict[str, Array]:
        return {"clean": self.rng(2073).uniform(0.4, 1.0, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        dusty = self.between(self.road, view)
        gains = (1.0 - dusty) * (1.0 - s.clean) / p.cleans_m - dusty * s.clean / p.dust_m
        s.clean = np.clip(s.clean + dt * speed * gains, 0.0, 1.0)
        peels = np.minimum(speed / 20.0, 1.5) ** p.power * (0.25 + 0.75 * s.clean)
        return -p.at_20 * peels * weight(view) * moving(view)
