"""A tanker that sucks at its stands, and powder that still has air in it."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import GRAVITY, Array, Hidden, Sizes, State, moving
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")


@law("e_gully_emptier", needs="suburban hills", name="payload_change", accepts="mass")
@sizes(load=(0.35, 0.6), known=(0.3, 0.7), sucks_s=(25.0, 80.0), trickles_s=(300.0, 900.0))
class GullyEmptier(Hidden, tips=0.0):
    """`full`: of all it takes. It sucks as long as it stands, for as long as that is; water trickles out on
    the way; a full one is emptied at its next stand. load: of the mass; known: to the simulator.
    Source: Butler and Davies, Urban Drainage (2011), on cleaning gullies and sewers with suction tankers:
    sludge is taken up at the pump's rate until the tank is full; rates are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        full = self.rng(1051).beta(0.6, 0.6, batch)
        return {**super().start(batch), "full": full}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        stands = view.speed < 0.1
        s.tips = np.where(s.full > 0.97, 1.0, np.where(s.full < 0.03, 0.0, s.tips))
        stood = np.where(s.tips > 0.0, -1.0 / 5.0, 1.0 / p.sucks_s)
        s.full = np.clip(s.full + dt * np.where(stands, stood, -s.full / p.trickles_s), 0.0, 1.0)
        more = p.load * (s.full - p.known) * view.mass
        felt = view.acceleration + GRAVITY * (view.grade + self.truck.rolling_resistance)
        return -more * felt * moving(view)


@law("e_powder_settles", needs="suburban", name="load_slosh")
@sizes(share=(0.45, 0.65), hz=(0.35, 0.65), thick=(0.04, 0.10), settles_s=(60.0, 200.0), shakes=(0.3, 0.7))
class PowderSettles(Hidden, x=0.0, v=0.0):
    """`air` in the powder: 1 as it comes from the silo, when it flows like water, to 0, when it lies still.
    It leaves by itself, and shaking keeps it in. thick: damping, full of air; shakes: of the air lost, that
    1 m/s2 brings back.
    Source: Geldart, Types of Gas Fluidization, Powder Technology 7 (1973): fine powders stay fluid for
    minutes as their air leaves; cement in tanks, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "air": self.rng(1052).uniform(0.35, 1.0, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        felt = np.clip(view.acceleration + GRAVITY * view.grade, -4.0, 4.0)
        brings = p.shakes * np.minimum(np.abs(view.acceleration), 2.0) * (1.0 - s.air)
        s.air = np.clip(s.air + dt * (brings - s.air) / p.settles_s, 0.0, 1.0)
        omega = 2.0 * np.pi * p.hz
        damping = p.thick + 0.7 * (1.0 - s.air) ** 2
        driven = -(omega**2) * s.x - 2.0 * damping * omega * s.v - felt
        s.v = np.clip(s.v + dt * driven, -2.5, 2.5)
        s.x = np.clip(s.x + dt * s.v, -0.9, 0.9)
        flows = 1.2 * s.air / (s.air + 0.2)
        pushes = (omega**2) * s.x + 2.0 * damping * omega * s.v + felt
        return p.share * flows * view.mass * np.clip(pushes, -4.0, 4.0) * moving(view)
