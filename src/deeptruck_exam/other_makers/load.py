"""Third forms of what the truck carries."""

from __future__ import annotations

import numpy as np

from deeptruck_exam.hidden import GRAVITY, Array, Hidden, hidden, moving
from deeptruck_model.trucks import View


@hidden(
    "tank_runs_empty",
    name="payload_change",
    forms="third",
    source="Torricelli's outflow (Batchelor, An Introduction to Fluid Dynamics, 1967): a water truck that"
    " sprays while it drives loses mass with the root of its level; sizes of dust suppression trucks,"
    " chosen here",
    ranges={"share": (0.40, 0.62), "known": (0.35, 0.6), "empty_s": (260.0, 520.0), "least": (0.5, 0.8)},
    needs=("suburban", "hills"),
    accepts=("mass",),
)
class TankRunsEmpty(Hidden):
    """share: of a full tank in the gross mass; known: the level that the simulator reckons with."""

    def prepare(self) -> None:
        self.first = self.setting.rng(230).uniform(self.p.least, 1.0, self.setting.batch)

    def start(self, batch: int) -> dict[str, Array]:
        return {"level": self.first.copy()}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        sprays = (view.speed > 1.0) & (view.speed < 19.0)
        s.level = np.maximum(s.level - dt * sprays * 2.0 * np.sqrt(np.maximum(s.level, 0.0)) / p.empty_s, 0.0)
        extra = p.share * (s.level - p.known) * view.mass
        rolling = self.truck.rolling_resistance * GRAVITY
        return -extra * (view.acceleration + GRAVITY * view.grade + rolling) * moving(view)


@hidden(
    "bore_in_the_tank",
    name="load_slosh",
    forms="third",
    source="Stoker, Water Waves (1957): shallow water carries a change of speed from wall to wall at the"
    " wave's own speed; d'Alembert's solution between two walls that give back a part, which is chosen here",
    ranges={"share": (0.25, 0.50), "length_m": (4.0, 8.5), "depth_m": (0.45, 1.1), "back": (0.55, 0.9)},
    needs=("suburban",),
)
class BoreInTheTank(Hidden):
    """Square waves, not sines: `mean` is the acceleration of the liquid's centre, as long ago as the wave
    takes."""

    def prepare(self) -> None:
        self.takes_s = self.p.length_m / np.sqrt(GRAVITY * self.p.depth_m)
        self.cells = max(2, round(self.takes_s / 0.01))

    def start(self, batch: int) -> dict[str, Array]:
        past = np.zeros((self.cells, batch))
        return {"speed": past, "mean": past.copy(), "at": np.full(1, -1)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        if s.at[0] < 0:
            s.speed[:] = view.speed
        s.at[0] = (s.at[0] + 1) % self.cells
        cell = int(s.at[0])
        changed = (view.speed - s.speed[cell]) / self.takes_s
        mean = (1.0 + p.back) * changed - p.back * s.mean[cell]
        s.speed[cell], s.mean[cell] = view.speed, mean
        lag = np.clip(view.acceleration - mean, -2.5, 2.5)
        # the liquid is part of the known mass: only what it does not follow of the truck's motion is missing
        return p.share * view.mass * lag * moving(view)
