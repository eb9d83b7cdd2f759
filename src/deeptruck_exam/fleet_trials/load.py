"""Fifth forms of what the truck carries: gravel that is spread, rows of small tanks, swinging carcasses."""

from __future__ import annotations

import numpy as np

from deeptruck_exam.hidden import GRAVITY, Array, Hidden, hidden, moving
from deeptruck_model.trucks import View


@hidden(
    "spreads_gravel",
    name="payload_change",
    forms="fifth",
    source="Winter service and gravel roads: a spreader loses a set mass for each metre while its disc turns"
    " (EN 15597-1 on dosage), the driver switches it; the simulator reckons with one mass for all drives;"
    " loads at the start and doses of coarse gravel are chosen here",
    ranges={"load": (0.35, 0.55), "known": (0.3, 0.6), "spread_m": (1800.0, 4500.0), "on": (0.45, 0.8)},
    needs=("suburban", "hills"),
    accepts=("mass",),
)
class SpreadsGravel(Hidden):
    """load: of the mass. Some drives begin with what another one left."""

    def prepare(self) -> None:
        rng, batch = self.setting.rng(441), self.setting.batch
        self.first = np.where(rng.random(batch) < 0.6, 1.0, rng.uniform(0.15, 0.7, batch))
        self.ends = np.cumsum(rng.exponential(220.0, (batch, 200)) + 60.0, axis=1)
        self.on = rng.random((batch, 200)) < self.p.on

    def start(self, batch: int) -> dict[str, Array]:
        return {"left": self.first.copy()}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        at = np.minimum((self.ends < view.distance[:, None]).sum(axis=1), 199)
        turns = self.on[np.arange(len(at)), at] & (view.speed > 1.0) & (view.speed < 18.0)
        s.left = np.maximum(s.left - dt * turns * view.speed / p.spread_m, 0.0)
        more = p.load * (s.left - p.known) * view.mass
        felt = view.acceleration + GRAVITY * (view.grade + self.truck.rolling_resistance)
        return -more * felt * moving(view)


@hidden(
    "rows_of_small_tanks",
    name="load_slosh",
    forms="fifth",
    source="Containers of a cubic metre on a platform: each sloshes at its own frequency by its own fill"
    " (Housner, Dynamic Pressures on Accelerated Fluid Containers, Bull. Seismol. Soc. Am. 47, 1957), so"
    " that the row falls out of step; breaking waves damp with the square of speed; fills chosen here",
    ranges={"share": (0.35, 0.6), "slowest_hz": (0.45, 0.7), "spread": (1.3, 1.9), "breaks": (0.3, 1.2)},
    needs=("suburban",),
)
class RowsOfSmallTanks(Hidden):
    """`at`, `rate` (5, batch): m and m/s of five groups of containers."""

    def prepare(self) -> None:
        hertz = self.p.slowest_hz * self.p.spread ** np.linspace(0.0, 1.0, 5)
        self.omega = 2.0 * np.pi * hertz[:, None]

    def start(self, batch: int) -> dict[str, Array]:
        return {"at": np.zeros((5, batch)), "rate": np.zeros((5, batch))}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        pull = self.omega**2 * s.at + (0.06 * self.omega + p.breaks * np.abs(s.rate)) * s.rate
        driven = -np.clip(view.acceleration, -5.0, 5.0) - pull
        s.rate = np.clip(s.rate + dt * driven, -2.0, 2.0)
        s.at = np.clip(s.at + dt * s.rate, -0.5, 0.5)
        # the mass is known; what it moves otherwise than the truck is not
        return -p.share * view.mass * driven.mean(axis=0) * moving(view)


@hidden(
    "swinging_carcasses",
    name="load_slosh",
    forms="fifth",
    source="Hanging meat is a known cause of roll-overs and surges (UK code of practice Safety of Loads on"
    " Vehicles, 2002): pendulums on a rail that strike their neighbours and the front wall, so that"
    " backward swing is free and forward swing is stopped; lengths and sizes are chosen here",
    ranges={"share": (0.25, 0.45), "length_m": (0.9, 1.7), "room": (0.04, 0.12), "stops": (3.0, 9.0)},
    needs=("suburban",),
)
class SwingingCarcasses(Hidden):
    """room: rad forward before all hang against each other; stops: stiffness there over gravity's."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"angle": np.zeros(batch), "rate": np.zeros(batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        pressed = np.maximum(s.angle - p.room, 0.0)
        damping = np.where(pressed > 0.0, 5.0, 0.25)
        felt = np.clip(view.acceleration, -5.0, 5.0) * np.cos(s.angle)
        turning = -(GRAVITY * (np.sin(s.angle) + p.stops * pressed) + felt) / p.length_m - damping * s.rate
        s.rate = np.clip(s.rate + dt * turning, -4.0, 4.0)
        s.angle = np.clip(s.angle + dt * s.rate, -0.9, 0.6)
        return -p.share * view.mass * p.length_m * turning * np.cos(s.angle) * moving(view)
