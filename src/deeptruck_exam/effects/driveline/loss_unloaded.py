"""Losses between flywheel and wheel that come where there is little load."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, eased, moving, weight
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, name="driveline_loss", accepts="torque_gain")


@law("y_rollers_skid_unloaded", "eighteenth", "hills suburban highway")
@sizes(most=(0.0032, 0.0055), light=(0.12, 0.25), at_mps=(11.0, 16.0), power=(0.6, 1.2), begins_s=(0.5, 1.5))
@sizes(smears=(0.3, 0.6), heals_s=(6.0, 20.0))
class RollersSkidUnloaded(Hidden, skids=0.0, film=1.0):
    """Large rollers need load to roll. With little torque they skid in their oil and lose much, and under
    load they roll and lose little. `skids`: of them. `film`: skidding smears it, so that the loss grows, and
    rolling builds it anew. most: of the weight, at at_mps; light: of peak torque; smears: of the film.
    Source: Harris and Kotzalas, Rolling Bearing Analysis (2006), on skidding of lightly loaded rollers; large
    bearings, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        load = np.abs(view.engine_torque) / self.truck.peak_torque / p.light
        s.skids = eased(s.skids, 1.0 / (1.0 + load**3), p.begins_s, dt)
        s.film = eased(s.film, 1.0 - p.smears * s.skids, p.heals_s, dt)
        fast = np.clip(view.speed / p.at_mps, 0.0, 1.8) ** p.power
        return -p.most * s.skids * fast / s.film * weight(view) * moving(view)
