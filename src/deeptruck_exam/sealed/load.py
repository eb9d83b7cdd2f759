"""Two tanks that a pipe joins, and a load that is laid into the holes of the road."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import GRAVITY, Array, Hidden, Sizes, State, moving
from deeptruck_exam.effects.places import CELL_M, CELLS, OnRoad
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")


@law("w_patches_the_road", needs="suburban hills", name="payload_change", accepts="mass")
@sizes(load=(0.4, 0.6), known=(0.3, 0.7), apart_m=(120.0, 350.0), takes=(0.08, 0.2), fills_s=(4.0, 12.0))
class PatchesTheRoad(OnRoad, stood=0.0):
    """`full`: of the hot mix that was loaded. Every hole that is passed takes a part, some much and some
    little; an empty truck is filled at its next stand. load: of the mass; known: to the simulator, of that;
    takes: of a full load, the mean hole.
    Source: Wilson and Romine, Materials and Procedures for Repair of Potholes in Asphalt-Surfaced Pavements,
    FHWA-RD-99-168 (1999), on spray injection from a truck; quicker work, sizes are chosen here."""

    def prepare(self) -> None:
        rng = self.rng(1151)
        self.road = np.zeros((self.rows(), CELLS))
        for row in self.road:
            at = np.cumsum(rng.exponential(self.p.apart_m, 2 * CELLS))
            cells = (at[at < CELL_M * (CELLS - 4)] / CELL_M).astype(int)
            size = self.p.takes * rng.gamma(2.0, 0.5, len(cells))
            for k in range(3):
                np.add.at(row, cells + k, size / (3.0 * CELL_M))

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "full": self.rng(1152).uniform(0.1, 1.0, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.stood = np.where(view.speed < 0.2, np.where(s.full < 0.15, 1.0, s.stood), 0.0)
        lays = self.read(self.road, view) * np.maximum(view.speed, 0.0)
        s.full = np.clip(s.full + dt * (s.stood / p.fills_s - lays * (view.speed > 0.2)), 0.0, 1.0)
        more = p.load * (s.full - p.known) * view.mass
        felt = view.acceleration + GRAVITY * (view.grade + self.truck.rolling_resistance)
        return -more * felt * moving(view)


@law("w_pipe_between_tanks", needs="suburban", name="load_slosh")
@sizes(share=(0.35, 0.6), hz=(0.16, 0.34), turns=(0.25, 0.8), rubs=(0.03, 0.10), room_m=(0.5, 1.1))
class PipeBetweenTanks(Hidden, x=0.0, v=0.0):
    """`x` m that the middle of the liquid has moved from the rear tank to the front one, `v` of that. A bend
    and a valve in the pipe hold fast flows more than slow ones, and a full tank stops it. share: of the mass;
    turns: 1/m, loss with the square of `v`; rubs: damping of slow flows.
    Source: Sakai, Takaeda and Tamaki, Tuned Liquid Column Damper, Int. Conf. Highrise Buildings, Nanjing
    (1989): a column in a U that an orifice damps; tanks of a road sprinkler, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        felt = np.clip(view.acceleration + GRAVITY * view.grade, -4.0, 4.0)
        omega = 2.0 * np.pi * p.hz
        beyond = s.x - np.clip(s.x, -p.room_m, p.room_m)
        holds = (2.0 * p.rubs * omega + p.turns * np.abs(s.v)) * s.v
        pace = -(omega**2) * s.x - 40.0 * beyond - holds - 3.0 * s.v * (beyond != 0.0) - 0.8 * felt
        pace = np.clip(pace, -4.0, 4.0)
        s.v = np.clip(s.v + dt * pace, -2.5, 2.5)
        s.x = np.clip(s.x + dt * s.v, -p.room_m - 0.3, p.room_m + 0.3)
        return -p.share * view.mass * pace * moving(view)
