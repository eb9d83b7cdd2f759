"""Axles that run askew. The tool has no name for them."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, eased, weight
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, name="unknown")


@law("b_axle_shifts_as_it_pulls", "twentieth", "suburban hills highway")
@sizes(most=(0.018, 0.03), shifts=(0.035, 0.06), sticks=(0.3, 0.6), power=(1.6, 2.2), moves_s=(0.15, 0.5))
class AxleShiftsAsItPulls(Hidden, askew=0.0):
    """The centre bolt of one spring is broken: when the axle pulls or brakes its loose end shifts fore or
    aft, and the wheels run askew. It sticks where it is until the force has changed enough, so that it stays
    askew after a pull, and straightens only with a small braking. most: of the weight, quite askew; shifts:
    of the weight, for that; sticks: of that force, before it moves.
    Source: Fancher, Ervin, MacAdam and Winkler, Measurement and Representation of the Mechanical Properties
    of Truck Leaf Springs, SAE 800905, on friction of springs, and Pacejka, Tire and Vehicle Dynamics (2012),
    on drag by slip angles; a broken bolt, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        force = np.clip((view.traction_force - view.brake_force) / (p.shifts * weight(view)), -1.5, 1.5)
        held = np.clip(s.askew, force - p.sticks, force + p.sticks)
        s.askew = eased(s.askew, held, p.moves_s, dt)
        ploughs = np.minimum(np.abs(s.askew), 1.1) ** p.power
        return -p.most * ploughs * weight(view) * np.clip(view.speed / 3.0, 0.0, 1.0)
