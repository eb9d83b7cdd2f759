"""Wind that traffic makes beside the road."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, name="headwind", accepts="drag_area")
TRAINS = 40  # within FAR_M of where a drive begins, both ways
FAR_M = 26000.0


@law("b_trains_run_alongside", "twentieth", "highway hills suburban")
@sizes(takes=(0.34, 0.52), train_mps=(27.0, 36.0), long_m=(600.0, 1100.0), grows_m=(120.0, 350.0))
@sizes(dies_m=(200.0, 500.0))
class TrainsRunAlongside(Hidden):
    """A railway lies close beside the road. Each goods train drags air along, ever more from its head to its
    end, and behind it that wind dies. takes: of the train's speed, that the air at its end has; grows_m: from
    its head, to two thirds of that; dies_m: behind its end.
    Source: Sterling, Baker, Jordan and Johnson, A Study of the Slipstreams of High-Speed Passenger Trains and
    Freight Trains, Proc. IMechE F 222 (2008); a busy line, sizes are chosen here."""

    def prepare(self) -> None:
        rng, p = self.rng(2001), self.p
        shape = (self.setting.batch, TRAINS)
        self.head = self.setting.start_m[:, None] + rng.uniform(-FAR_M, FAR_M, shape)
        self.pace = rng.choice([-1.0, 1.0], shape) * p.train_mps * rng.uniform(0.8, 1.1, shape)
        self.long = p.long_m * rng.uniform(0.6, 1.2, shape)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        head = self.head + self.pace * view.time
        behind = np.sign(self.pace) * (head - self.place(view)[:, None])
        along = 1.0 - np.exp(-np.clip(behind, 0.0, self.long) / p.grows_m)
        left = np.exp(-np.maximum(behind - self.long, 0.0) / p.dies_m)
        wind = np.clip((p.takes * self.pace * along * left).sum(axis=1), -16.0, 16.0)
        against = np.clip(1.0 - self.setting.direction * wind / np.maximum(view.speed, 3.0), -1.0, 2.5)
        return -(against * np.abs(against) - 1.0) * view.drag_force * np.clip(view.speed / 3.0, 0.0, 1.0)
