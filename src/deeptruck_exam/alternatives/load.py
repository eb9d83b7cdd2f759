"""Second forms of what the truck carries."""

from __future__ import annotations

import numpy as np

from deeptruck_exam.hidden import GRAVITY, Array, Hidden, hidden, moving
from deeptruck_model.trucks import View


@hidden(
    "round_of_stops",
    name="payload_change",
    forms="second",
    source="Collection and delivery rounds: mass in steps at standstills (refuse, milk, drinks); Newton's"
    " second law, sizes chosen here",
    ranges={"first": (0.05, 0.15), "each": (0.06, 0.16), "sign": (-1.0, 1.0), "least_s": (1.0, 2.0)},
    needs=("suburban",),
    accepts=("mass",),
)
class RoundOfStops(Hidden):
    """A truck that starts full or empty and is lighter or heavier after every stop."""

    def prepare(self) -> None:
        rng, batch = self.setting.rng(130), self.setting.batch
        way = 1.0 if self.p.sign > 0.0 else -1.0
        steps = self.p.each * rng.uniform(0.5, 1.5, (batch, 12))
        steps[:, 0] = self.p.first * rng.integers(0, 2, batch)
        self.share = np.clip(way * np.cumsum(steps, axis=1), -0.35, 0.55)

    def start(self, batch: int) -> dict[str, Array]:
        return {"stood": np.zeros(batch), "stops": np.zeros(batch)}

    def newtons(self, view: View, dt: float) -> Array:
        s = self.s
        before = s.stood
        s.stood = np.where(view.speed < 0.05, before + dt, 0.0)
        served = (before < self.p.least_s) & (s.stood >= self.p.least_s) & (view.time > 5.0)
        s.stops = np.minimum(s.stops + served, self.share.shape[1] - 1)
        extra = view.mass * self.share[np.arange(len(before)), s.stops.astype(int)]
        rolling = self.truck.rolling_resistance * GRAVITY
        return -extra * (view.acceleration + GRAVITY * view.grade + rolling) * moving(view)


@hidden(
    "baffled_tank",
    name="load_slosh",
    forms="second",
    source="Ibrahim, Liquid Sloshing Dynamics (2005): frequencies and masses of the first and third"
    " antisymmetric mode of a rectangular tank; damping of baffles with the square of the flow, chosen here",
    ranges={
        "share": (0.35, 0.65),  # liquid over gross mass
        "length_m": (4.5, 9.0),
        "fill": (0.12, 0.30),  # depth over length
        "baffles": (0.3, 1.2),  # 1/m
    },
    needs=("suburban",),
)
class BaffledTank(Hidden):
    """Two waves at a time, which die the faster the higher they are."""

    def prepare(self) -> None:
        n = np.array([[1.0], [3.0]])
        depth = n * np.pi * self.p.fill
        self.omega2 = n * np.pi * GRAVITY / self.p.length_m * np.tanh(depth)
        self.part = 8.0 * np.tanh(depth) / (n**2 * np.pi**2 * depth)

    def start(self, batch: int) -> dict[str, Array]:
        return {"way": np.zeros((2, batch)), "rate": np.zeros((2, batch))}

    def newtons(self, view: View, dt: float) -> Array:
        s = self.s
        damping = (self.p.baffles * np.abs(s.rate) + 0.02 * np.sqrt(self.omega2)) * s.rate
        driven = -self.omega2 * s.way - damping - np.clip(view.acceleration, -6.0, 6.0)
        s.rate += dt * driven
        s.way = np.clip(s.way + dt * s.rate, -1.5, 1.5)
        # the liquid is part of the known mass: what it does not follow of the truck's motion is missing
        moved = (self.part * driven).sum(axis=0)
        return -self.p.share * view.mass * moved * moving(view)
