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
