"""Losses between flywheel and wheel while their oil is cold."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Sizes, State, moving, weight
from deeptruck_exam.effects.places import OnRoad, windows
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, name="driveline_loss", accepts="torque_gain")


@law("h_fords_chill_the_axle", "nineteenth", "hills suburban highway")
@sizes(
    most=(0.008, 0.0135), thins=(1.6, 2.8), warms_s=(25.0, 70.0), chills_s=(3.0, 9.0), mean_m=(120.0, 350.0)
)
@sizes(share=(0.15, 0.35))
class FordsChillTheAxle(OnRoad):
    """`warm`: oil in an axle, that its own churning and load warm. Where the road runs through water the
    housing is chilled at once, and the oil is thick again for a minute. most: of the weight, at 15 m/s with
    cold oil; thins: power of the warmth; chills_s: in water.
    Source: Naunheimer, Bertsche, Ryborz and Novak, Automotive Transmissions (2011), on churning by viscosity,
    and Incropera and DeWitt, Fundamentals of Heat and Mass Transfer (1996), on wet walls; sizes are chosen
    here."""

    def prepare(self) -> None:
        self.road = windows(self.rng(1931), self.rows(), self.p.mean_m, self.p.share)

    def start(self, batch: int) -> dict[str, Array]:
        return {"warm": self.rng(1932).uniform(0.0, 0.8, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        fast = np.clip(view.speed / 15.0, 0.0, 1.8)
        load = np.clip(np.abs(view.engine_torque) / self.truck.peak_torque, 0.0, 1.1)
        thick = np.exp(-p.thins * s.warm)
        warms = (0.9 * load + 0.6 * fast * thick) * fast * (1.0 - s.warm) / p.warms_s
        s.warm = np.clip(
            s.warm + dt * (warms - self.between(self.road, view) * s.warm / p.chills_s), 0.0, 1.0
        )
        return -p.most * thick * np.sqrt(fast) * (0.6 + 0.4 * load) * weight(view) * moving(view)
