"""Losses between flywheel and wheel that come where there is much load."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, eased, moving
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, name="driveline_loss", accepts="torque_gain")


@law("b_teeth_touch_at_their_edges", "twentieth", "hills suburban highway")
@sizes(most=(0.2, 0.32), bends=(0.35, 0.6), power=(2.0, 4.0), warms_s=(10.0, 30.0), warps=(0.3, 0.7))
class TeethTouchAtTheirEdges(Hidden):
    """A weak housing bends under torque until the teeth touch at their edges alone: little is lost at half
    torque and a good share beyond it. `warm` housing bends sooner. most: of the torque, lost; bends: of peak
    torque, where half of that is lost; warps: of it, less when warm.
    Source: Niemann and Winter, Maschinenelemente II (2003), on face load by misalignment under torque, and
    Naunheimer, Bertsche, Ryborz and Novak, Automotive Transmissions (2011), on losses of the mesh; a weak
    housing, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"warm": self.rng(2031).uniform(0.1, 0.8, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        load = np.clip(np.abs(view.engine_torque) / self.truck.peak_torque, 0.0, 1.1)
        s.warm = eased(s.warm, np.clip(1.3 * self.power_share(view), 0.0, 1.0), p.warms_s, dt)
        half = p.bends * (1.0 - p.warps * (s.warm - 0.5))
        edge = load**p.power / (load**p.power + half**p.power)
        return -p.most * edge * np.abs(self.at_wheels(view, view.engine_torque)) * moving(view)
