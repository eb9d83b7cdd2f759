"""Rolling resistance of seals, which changes with speed."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, eased, moving, weight
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, name="rolling_resistance_speed", accepts="drag_area rolling_resistance")


@law("y_seals_ride_up", "eighteenth", "highway hills suburban")
@sizes(
    slow=(0.009, 0.015), rides_mps=(4.0, 8.0), films=(0.003, 0.006), builds_s=(1.5, 5.0), breaks_s=(0.4, 1.2)
)
class SealsRideUp(Hidden, film=0.0):
    """Many tight seals at hubs and shafts rub dry when they turn slowly. Faster, they ride up on a film and
    rub little; then the film itself costs more with the root of speed. `film`: builds slowly and breaks soon.
    slow: of the weight, rubbing dry; rides_mps: where half is lifted; films: of the weight, at 20 m/s.
    Source: Müller and Nau, Fluid Sealing Technology (1998), on lip seals between dry rubbing and a film; many
    seals, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        wish = 1.0 - np.exp(-((speed / p.rides_mps) ** 2) * 0.7)
        s.film = eased(s.film, wish, np.where(wish > s.film, p.builds_s, p.breaks_s), dt)
        cost = p.slow * (1.0 - s.film) + p.films * s.film * np.sqrt(speed / 20.0)
        return -cost * weight(view) * moving(view)


@law("u_oil_whirls_in_the_hubs", "twenty-first", "highway hills suburban")
@sizes(
    at_20=(0.011, 0.017), turns_mps=(9.0, 13.0), power=(1.6, 1.9), warms_s=(40.0, 120.0), thins=(0.35, 0.6)
)
class OilWhirlsInTheHubs(Hidden):
    """Hubs run in oil. Slow, it is sheared evenly and resists with speed; beyond one speed it whirls, and
    resists with a larger power. `warm` oil is thinner: it resists less, and begins to whirl at a lower speed.
    at_20: of the weight, at 20 m/s in cold oil; turns_mps: where cold oil begins to whirl; thins: of its
    thickness, warm.
    Source: Bilgen and Boulos, Functional Dependence of Torque Coefficient of Coaxial Cylinders, J. Fluids
    Engineering 95 (1973), on both powers; overfilled hubs, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"warm": self.rng(2171).uniform(0.0, 0.7, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.clip(view.speed, 0.0, 30.0)
        thick = 1.0 - p.thins * s.warm
        turns = p.turns_mps * thick
        shears = thick * speed / p.turns_mps
        whirls = thick**2 * (np.maximum(speed, turns) / turns) ** p.power
        cold = (20.0 / p.turns_mps) ** p.power
        drag = np.where(speed > turns, whirls, shears) / cold
        s.warm = eased(s.warm, np.clip(speed / 20.0, 0.0, 1.2), p.warms_s, dt)
        return -p.at_20 * drag * weight(view) * moving(view)
