"""Wheels that slip by their treads."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, moving, weight
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, name="wheel_slip")


@law("b_tall_treads_creep", "twentieth", "suburban hills", accepts="driveline_loss")
@sizes(stiff=(0.5, 0.85), driven=(0.35, 0.5), heats_s=(6.0, 18.0), softens=(0.4, 0.8), most=(0.4, 0.55))
class TallTreadsCreep(Hidden):
    """Tall soft blocks bend as they pull, and the tyre creeps without gliding anywhere: by the pull over the
    load, with no threshold, so that what is lost goes with the square of the pull. `heat` of the blocks, from
    that work, makes them softer. stiff: pull over load, for a creep of 1; softens: of it, at a heat of 1.
    Source: Pacejka, Tire and Vehicle Dynamics (2012), on the brush model and its slip stiffness; very soft
    blocks, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"heat": self.rng(2071).uniform(0.0, 0.6, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        pull = np.maximum(view.traction_force, 0.0)
        hard = pull / (p.driven * weight(view))
        creep = np.minimum(hard / (p.stiff * (1.0 - p.softens * np.minimum(s.heat, 1.0) * 0.7)), p.most)
        works = 4.0 * creep * np.minimum(hard, 0.6) * np.clip(view.speed / 6.0, 0.0, 2.0)
        s.heat = np.clip(s.heat + dt * (works - 0.25 * s.heat) / p.heats_s, 0.0, 1.2)
        return -creep * pull * moving(view)
