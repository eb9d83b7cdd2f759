"""Twin tyres that are not alike. The tool has no name for them."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, eased, moving, weight
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, name="unknown")


@law("u_twins_are_of_unlike_size", "twenty-first", "suburban hills highway")
@sizes(most=(0.02, 0.034), unlike=(0.5, 0.8), grows=(1.2, 1.7), warms_s=(15.0, 45.0), works=(0.04, 0.08))
class TwinsAreOfUnlikeSize(Hidden):
    """Two tyres on one hub are of unlike size, so that one always scrubs. The smaller one is worked harder by
    each pull and braking; it gets hot and grows to the size of its twin and beyond: drag falls to nothing
    and comes again from the other side. `hot`: that tyre. most: of the weight, at a difference of 1; unlike:
    the difference, cold; grows: of it, by a heat of 1; works: force over weight, that heats it wholly.
    Source: makers' manuals on the matching of dual tyres, and The Pneumatic Tire, ed. Gent and Walter, NHTSA
    DOT HS 810 561 (2006), on pressure and size by heat; sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"hot": self.rng(2173).uniform(0.0, 0.8, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        force = np.abs(view.traction_force - view.brake_force) / weight(view)
        wish = np.clip(force / p.works, 0.0, 1.0) * np.clip(view.speed / 6.0, 0.0, 1.0)
        s.hot = eased(s.hot, wish, p.warms_s, dt)
        scrubs = np.abs(p.unlike - p.grows * s.hot)
        return -p.most * np.tanh(1.5 * scrubs) * weight(view) * moving(view)
