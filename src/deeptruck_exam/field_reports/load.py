"""Fourth forms of what the truck carries."""

from __future__ import annotations

import numpy as np

from deeptruck_exam.hidden import GRAVITY, Array, Hidden, hidden, moving
from deeptruck_model.trucks import View


@hidden(
    "quarry_shuttle",
    name="payload_change",
    forms="fourth",
    source="Shuttles between pit and plant run full one way and empty the other (Caterpillar Performance"
    " Handbook, on haul cycles); bucket loads spread by several per cent (payload management guidelines,"
    " 10/10/20); the simulator reckons with the mean of both ways; sizes are chosen here",
    ranges={"full": (0.22, 0.48), "empty": (0.18, 0.36), "spread": (0.03, 0.08)},
    needs=("suburban", "hills"),
    accepts=("mass",),
)
class QuarryShuttle(Hidden):
    """The direction on the road decides; a few return loads are carried too."""

    def prepare(self) -> None:
        rng, batch = self.setting.rng(360), self.setting.batch
        full = (self.setting.direction > 0) ^ (rng.random(batch) < 0.1)
        share = np.where(full, self.p.full, -self.p.empty)
        self.share = share + self.p.spread * rng.normal(0.0, 1.0, batch)

    def newtons(self, view: View, dt: float) -> Array:
        rolling = self.truck.rolling_resistance * GRAVITY
        felt = view.acceleration + GRAVITY * view.grade + rolling
        return -self.share * view.mass * felt * moving(view)


@hidden(
    "through_swash_plates",
    name="load_slosh",
    forms="fourth",
    source="Compartments joined by holes in swash plates (UN Regulation ADR 6.8.2.1.22 on surge plates;"
    " Idelchik, Handbook of Hydraulic Resistance, on orifices): liquid columns of some inertia driven by the"
    " tilt of the surface, braked by the square of their flow; three compartments, sizes chosen here",
    ranges={
        "share": (0.35, 0.65),
        "length_m": (2.0, 4.0),  # of one compartment
        "depth_m": (0.6, 1.3),
        "orifice": (0.15, 0.6),  # 1/m
    },
    needs=("suburban",),
)
class ThroughSwashPlates(Hidden):
    """`flow` (2, batch) m/s between compartments, `level` (3, batch) m above the mean."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"flow": np.zeros((2, batch)), "level": np.zeros((3, batch))}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        head = GRAVITY * (s.level[:-1] - s.level[1:]) / p.length_m
        driven = head - np.clip(view.acceleration, -5.0, 5.0) - p.orifice * s.flow * np.abs(s.flow)
        driven -= 0.15 * s.flow  # films on the walls
        s.flow = np.clip(s.flow + dt * driven, -2.5, 2.5)
        rises = dt * p.depth_m / p.length_m * s.flow
        s.level[:-1] -= rises
        s.level[1:] += rises
        s.level = np.clip(s.level, -0.8 * p.depth_m, 0.8 * p.depth_m)
        # the liquid is part of the known mass: what it does not follow of the truck's motion is missing
        return -p.share * view.mass * driven.mean(axis=0) * moving(view)
