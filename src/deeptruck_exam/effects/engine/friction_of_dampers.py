"""Friction of what swings on the crankshaft."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, eased, moving
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, name="engine_friction", accepts="engine_brake accessory_load")


@law("u_damper_swings_along", "twenty-first", accepts="accessory_load engine_brake torque_gain")
@sizes(nm=(260.0, 420.0), at_rads=(125.0, 150.0), wide=(0.1, 0.18), still=(0.25, 0.4), heats_s=(12.0, 35.0))
@sizes(softens=(0.1, 0.22))
class DamperSwingsAlong(Hidden):
    """A damper of rubber on the crankshaft swings where the firing meets its own tone, and takes power there,
    more under load. `hot` rubber is softer, so that its tone and the speed that costs most come down. nm: at
    full load, on its tone; at_rads: of the cold rubber; still: of it, with no load; wide: of that speed.
    Source: Den Hartog, Mechanical Vibrations (1956), and Maass and Klier, Kräfte, Momente und deren Ausgleich
    in der Verbrennungskraftmaschine (1981), on dampers of crankshafts and their heat; sizes are chosen
    here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"hot": self.rng(2144).uniform(0.0, 0.8, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        load = np.clip(np.abs(view.engine_torque) / self.truck.peak_torque, 0.0, 1.0)
        tone = p.at_rads * (1.0 - p.softens * s.hot)
        swings = 1.0 / (1.0 + ((view.engine_speed / tone - 1.0) / p.wide) ** 2)
        takes = swings * (p.still + (1.0 - p.still) * load)
        s.hot = eased(s.hot, np.clip(1.5 * takes, 0.0, 1.0), p.heats_s, dt)
        return -self.at_wheels(view, p.nm * takes) * moving(view)
