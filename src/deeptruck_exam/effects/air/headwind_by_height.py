"""Wind that changes with height."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, index
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_exam.effects.series import ou_series
from deeptruck_model.trucks import View

law = partial(hidden, name="headwind", accepts="drag_area")


@law("h_wind_above_the_lid", "nineteenth", "hills highway descent")
@sizes(
    wind_mps=(10.0, 14.5), below=(0.05, 0.2), thick_m=(2.0, 5.0), waves_m=(4.0, 9.0), waves_s=(50.0, 140.0)
)
class WindAboveTheLid(Hidden, climbed=0.0):
    """Cold air lies in the low land under a lid, nearly still, and a wind blows along the road above it.
    Waves run along the lid, so that it rises and sinks over a truck. `climbed` m since the start. wind_mps:
    above; below: of that, under the lid; thick_m: over which both pass into each other; waves_m: of the lid.
    Source: Stull, An Introduction to Boundary Layer Meteorology (1988), on inversions that part a wind from
    still air and carry waves; heights and sizes are chosen here."""

    def prepare(self) -> None:
        rng, batch, p = self.rng(1901), self.setting.batch, self.p
        seconds = int(self.setting.duration_s) + 3
        self.lid = p.waves_m * ou_series(rng, (batch, seconds), 1.0, p.waves_s)
        self.lid += rng.uniform(-4.0, 6.0, (batch, 1))
        self.blows = rng.choice([-1.0, 1.0]) * p.wind_mps

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.climbed = s.climbed + dt * np.maximum(view.speed, 0.0) * view.grade
        second = index(view, self.lid)
        later = self.lid[:, min(second + 1, self.lid.shape[1] - 1)]
        lid = self.lid[:, second] + (view.time - second) * (later - self.lid[:, second])
        above = 1.0 / (1.0 + np.exp(np.clip((lid - s.climbed) / p.thick_m, -30.0, 30.0)))
        wind = self.blows * (p.below + (1.0 - p.below) * above)
        against = np.clip(1.0 - self.setting.direction * wind / np.maximum(view.speed, 3.0), -1.0, 2.5)
        return -(against * np.abs(against) - 1.0) * view.drag_force * np.clip(view.speed / 3.0, 0.0, 1.0)
