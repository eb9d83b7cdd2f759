"""What is dragged over the ground. The tool has no name for it."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Sizes, State, eased, moving, weight
from deeptruck_exam.effects.places import OnRoad, windows
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, name="unknown")


@law("y_chain_drags_behind", "eighteenth", "suburban hills highway")
@sizes(heavy=(0.009, 0.015), flies_mps=(9.0, 14.0), power=(2.0, 4.0), gravel=(0.8, 1.6), hops=(0.25, 0.5))
@sizes(mean_m=(150.0, 500.0), share=(0.3, 0.6))
class ChainDragsBehind(OnRoad, lies=1.0):
    """A long anchor chain drags on the ground behind the truck. `lies`: of it on the ground. The faster the
    truck, the more of it is lifted, by the pull along it and by the wind, and the less it holds. On gravel it
    digs in. heavy: of the weight, at rest on asphalt; flies_mps: where half is lifted; gravel: more by that;
    hops: less as it jumps.
    Source: Irvine, Cable Structures (1981), on lines that lie partly on the ground, and Hoerner,
    Fluid-Dynamic Drag (1965), on towed lines; a heavy chain, sizes are chosen here."""

    def prepare(self) -> None:
        self.road = windows(self.rng(1853), self.rows(), self.p.mean_m, self.p.share)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed, gravel = np.maximum(view.speed, 0.0), self.between(self.road, view)
        wish = 1.0 / (1.0 + (speed / p.flies_mps) ** p.power)
        s.lies = eased(s.lies, wish, 1.2, dt)
        jumps = 1.0 - p.hops * np.clip(speed / 8.0, 0.0, 1.0) * (1.0 - gravel)
        return -p.heavy * s.lies * (1.0 + p.gravel * gravel) * jumps * weight(view) * moving(view)
