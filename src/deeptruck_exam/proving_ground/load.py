"""Seventh forms of what the truck carries: a load that goes over the rim, concrete that yields."""

from __future__ import annotations

import numpy as np

from deeptruck_exam.breakdown_records.air import spells, within
from deeptruck_exam.hidden import GRAVITY, Array, Hidden, moving
from deeptruck_exam.proving_ground.law import Law, law
from deeptruck_model.trucks import View


@law(
    "over_the_rim",
    name="payload_change",
    source="Open water ballast on proving grounds, filled from a hose alongside: a free surface tilts with"
    " acceleration and slope (Ibrahim, Liquid Sloshing Dynamics, 2005), and what rises above the rim is lost"
    " within seconds, so that the hardest braking yet sets the mass",
    # load: of the mass, full to the rim; known: to the simulator, of it; tilts: for each unit of slope
    ranges={"load": (0.35, 0.55), "known": (0.45, 0.75), "tilts": (2.2, 4.5), "hose_s": (70.0, 180.0)},
    needs=("suburban", "hills"),
    accepts=("mass",),
)
class OverTheRim(Hidden):
    """The hose runs in spells below 14 m/s."""

    def prepare(self) -> None:
        rng, batch = self.setting.rng(703), self.setting.batch
        self.hose = spells(rng, batch, (20.0, 60.0), (30.0, 80.0))
        self.first = np.where(rng.random(batch) < 0.5, 1.0, rng.uniform(0.1, 0.8, batch))

    def start(self, batch: int) -> dict[str, Array]:
        return {"water": self.first.copy(), "tilt": np.zeros(batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        felt = np.clip(view.acceleration, -3.0, 3.0) / GRAVITY + view.grade
        s.tilt += dt * (felt - s.tilt) / 0.7
        over = np.maximum(s.water + 0.5 * p.tilts * np.abs(s.tilt) - 1.0, 0.0)
        runs = within(self.hose, view.time) * (view.speed < 14.0) / p.hose_s
        s.water = np.clip(s.water + dt * (runs - over / 1.2), 0.0, 1.0)
        more = p.load * (s.water - p.known) * view.mass
        level = view.grade + self.truck.rolling_resistance
        return -more * (view.acceleration + GRAVITY * level) * moving(view)


@law(
    "concrete_yields",
    name="load_slosh",
    source="Tattersall and Banfill, The Rheology of Fresh Concrete (1983): a Bingham body stays where it is"
    " until a yield stress is passed, then creeps by what is beyond it; half a drum of a stiff mix, with its"
    " own slope pushing it back",
    # yields: m/s2; back: 1/s2
    ranges={"share": (0.35, 0.6), "yields": (0.12, 0.35), "creeps_s": (0.25, 0.8), "back": (0.5, 1.6)},
    needs=("suburban",),
)
class ConcreteYields(Law, at=0.0, pace=0.0):
    """`at` m and `pace` m/s of the load's middle; it may rest anywhere within its yield."""

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        pushed = -np.clip(view.acceleration, -4.0, 4.0) - GRAVITY * view.grade - p.back * s.at
        free = np.sign(pushed) * np.maximum(np.abs(pushed) - p.yields, 0.0)
        runs = np.where(s.pace == 0.0, free, pushed - p.yields * np.tanh(s.pace / 0.02))
        turning = np.clip(runs - s.pace / p.creeps_s, -5.0, 5.0)
        s.pace = np.clip(s.pace + dt * turning, -1.5, 1.5)
        s.at = np.clip(s.at + dt * s.pace, -1.2, 1.2)
        return -p.share * view.mass * turning * moving(view)
