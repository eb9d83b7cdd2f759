"""Wind that water makes beside the road."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, index
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_exam.effects.series import ou_series
from deeptruck_model.trucks import View

law = partial(hidden, name="headwind", accepts="drag_area")
LAKES = 24  # along a road


@law("u_lakes_breathe", "twenty-first", "highway hills suburban")
@sizes(wind_mps=(8.0, 12.5), wide_m=(700.0, 1500.0), apart_m=(2800.0, 5000.0), pulses_s=(50.0, 150.0))
class LakesBreathe(Hidden):
    """The road passes one lake after the other. On a warm day air flows off each lake to all sides, and by
    night towards it: the wind turns round as a lake is passed. It is strongest at some way from the lake and
    dies beyond. wind_mps: at most; wide_m: way from the lake to where it blows most.
    Source: Simpson, Sea Breeze and Local Winds (1994), on breezes of lakes by day and by night; small warm
    lakes, sizes are chosen here."""

    def prepare(self) -> None:
        rng, p = self.rng(2101), self.p
        rows, seconds = int(self.setting.route.max()) + 1, int(self.setting.duration_s) + 3
        steps = p.apart_m * rng.uniform(0.6, 1.4, (rows, LAKES))
        self.lakes = np.cumsum(steps, axis=1) - rng.uniform(0.0, p.apart_m, (rows, 1))
        self.blows = rng.choice([-1.0, 1.0]) * p.wind_mps
        pulse = ou_series(rng, (self.setting.batch, seconds), 1.0, p.pulses_s)
        self.pulse = np.clip(1.0 + 0.25 * pulse, 0.4, 1.6)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        off = (self.place(view)[:, None] - self.lakes[self.setting.route]) / p.wide_m
        shape = np.clip((off * np.exp(0.5 - 0.5 * off**2)).sum(axis=1), -1.2, 1.2)
        wind = self.blows * shape * self.pulse[:, index(view, self.pulse)]
        against = np.clip(1.0 - self.setting.direction * wind / np.maximum(view.speed, 3.0), -1.0, 2.5)
        return -(against * np.abs(against) - 1.0) * view.drag_force * np.clip(view.speed / 3.0, 0.0, 1.0)
