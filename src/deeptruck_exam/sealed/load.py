"""A load that soaks, one that swirls, and one that is dragged."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import GRAVITY, Array, Hidden, Sizes, State, index, moving, weight
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_exam.effects.series import ou_series, spells, within
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")


@law("t_peat_soaks", needs="suburban hills", name="payload_change", accepts="mass")
@sizes(load=(0.45, 0.7), known=(0.2, 0.8), soaks_s=(40.0, 150.0), drains_s=(80.0, 260.0))
class PeatSoaks(Hidden):
    """`wet`: of all the water it can take. An open load takes up rain, quickly while it is dry, and drains.
    load: of the mass, all its water; known: to the simulator, of it.
    Source: Hall and Hoff, Water Transport in Brick, Stone and Concrete (2012), on sorptivity: what is soaked
    up grows with the root of time; peat and bark hold more than their own mass, showers are chosen here."""

    def prepare(self) -> None:
        rng, batch = self.rng(985), self.setting.batch
        self.rain = spells(rng, batch, (20.0, 70.0), (30.0, 90.0))
        self.first = rng.beta(0.7, 0.7, batch)

    def start(self, batch: int) -> dict[str, Array]:
        return {"wet": self.first.copy()}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        soaks = within(self.rain, view.time) * (1.0 - s.wet) / (2.0 * np.maximum(s.wet, 0.15) * p.soaks_s)
        s.wet = np.clip(s.wet + dt * (soaks - s.wet / p.drains_s), 0.0, 1.0)
        more = p.load * (s.wet - p.known) * view.mass
        felt = view.acceleration + GRAVITY * (view.grade + self.truck.rolling_resistance)
        return -more * felt * moving(view)


@law("t_liquid_swirls", needs="suburban", name="load_slosh")
@sizes(share=(0.28, 0.5), hz=(0.35, 0.65), damping=(0.02, 0.07), softens=(0.8, 2.5))
class LiquidSwirls(Hidden, x=0.0, y=0.0, vx=0.0, vy=0.0):
    """Swings fore and aft pass into swings aside and come back. softens: 1/m2; share: of the mass.
    Source: Miles, Resonantly Forced Surface Waves in a Circular Cylinder, J. Fluid Mech. 149 (1984): both
    swings of a round tank have one frequency, which falls as they grow, and feed each other; upright tanks,
    the road's unrest aside and sizes are chosen here."""

    def prepare(self) -> None:
        shape = (self.setting.batch, int(self.setting.duration_s / 0.1) + 20)
        self.aside = 0.2 * ou_series(self.rng(986), shape, 0.1, 1.5)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        omega = 2.0 * np.pi * p.hz
        soft = omega**2 * np.maximum(1.0 - p.softens * (s.x**2 + s.y**2), 0.4)
        cross = 0.6 * omega**2 * p.softens * s.x * s.y
        damps = 2.0 * p.damping * omega
        driven = -soft * s.x + cross * s.y - damps * s.vx - np.clip(view.acceleration, -4.0, 4.0)
        beside = self.aside[:, index(view, self.aside, 0.1)]
        s.vx = np.clip(s.vx + dt * driven, -2.5, 2.5)
        s.vy = np.clip(s.vy + dt * (-soft * s.y - cross * s.x - damps * s.vy + beside), -2.5, 2.5)
        s.x, s.y = np.clip(s.x + dt * s.vx, -0.8, 0.8), np.clip(s.y + dt * s.vy, -0.8, 0.8)
        return -p.share * view.mass * np.clip(driven, -4.0, 4.0) * moving(view)


@law("t_drags_logs", needs="suburban hills", name="unknown")
@sizes(drags=(0.009, 0.02), ploughs=(0.2, 0.7), heaps_m=(30.0, 140.0), takes_s=(1.5, 4.0))
class DragsLogs(Hidden, stood=0.0, stops=0.0, heap=0.0):
    """Logs lie with one end on the ground and push up a heap of earth before them; at each stand that lasts
    some are put down or taken on. drags: of the truck's weight; ploughs: more of it, with the whole heap.
    Source: Hassan and Gustafson, Factors Affecting Tree Skidding Forces, Transactions of the ASAE 26 (1983):
    friction on the ground and soil pushed ahead; bundles and soils are chosen here."""

    def prepare(self) -> None:
        rng, shape = self.rng(987), (self.setting.batch, 200)
        self.loads = rng.uniform(0.4, 1.1, shape) * (rng.random(shape) < 0.7)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        stood = np.where(view.speed < 0.1, s.stood + dt, 0.0)
        s.stops = s.stops + ((stood >= p.takes_s) & (s.stood < p.takes_s))
        s.stood = stood
        load = self.loads[np.arange(len(stood)), s.stops.astype(int) % self.loads.shape[1]]
        grows = np.maximum(view.speed, 0.0) * (1.0 - s.heap) / p.heaps_m
        s.heap = np.where(stood > 0.5, 0.0, s.heap + dt * grows)
        return -p.drags * load * (1.0 + p.ploughs * s.heap) * weight(view) * moving(view)
