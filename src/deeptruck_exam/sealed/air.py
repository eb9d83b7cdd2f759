"""Whirls of hot air beside the road, spray in a leader's wake, and a boom that swings out in bends."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Sizes, State, eased, moving
from deeptruck_exam.effects.places import Bends, OnRoad, windows
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")
WHIRLS = 400  # over all the road


@law("z_whirls_of_hot_air", needs="highway hills", name="headwind", accepts="drag_area")
@sizes(
    mean_mps=(3.0, 5.0),
    spins_mps=(12.0, 18.0),
    core_m=(60.0, 140.0),
    aside_m=(40.0, 160.0),
    lives_s=(60.0, 200.0),
)
class WhirlsOfHotAir(OnRoad):
    """Whirls of hot air stand beside the road, each for some minutes. One blows along the road as long as a
    truck is near, one way or the other by its side and its sense of turning. mean_mps: of the wind besides;
    spins_mps: at the edge of a core; aside_m: of their middle from the road, usually.
    Source: Sinclair, The Lower Structure of Dust Devils, J. Atmospheric Sciences 30 (1973), and Burgers, A
    Mathematical Model Illustrating the Theory of Turbulence (1948), on whirls with a core; large ones, sizes
    are chosen here."""

    def prepare(self) -> None:
        rng, p = self.rng(1701), self.p
        at = rng.uniform(0.0, 60000.0, (self.rows(), WHIRLS))
        aside = rng.choice([-1.0, 1.0], at.shape) * p.aside_m * rng.uniform(0.4, 1.6, at.shape)
        turns, phase = rng.uniform(0.5, 1.0, at.shape), rng.uniform(0.0, 1.0, at.shape)
        self.at, self.aside, self.turns, self.phase = (
            rows[self.setting.route] for rows in (at, aside, turns, phase)
        )
        self.blows = rng.choice([-1.0, 1.0]) * p.mean_mps

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        radius = np.sqrt((self.place(view)[:, None] - self.at) ** 2 + self.aside**2)
        round_ = p.spins_mps * 1.4 * p.core_m / radius * (1.0 - np.exp(-((radius / p.core_m) ** 2)))
        lives = np.sin(np.pi * (view.time / (3.0 * p.lives_s) + self.phase)) ** 2
        along = (round_ * self.turns * lives * self.aside / radius).sum(axis=1) + self.blows
        against = np.clip(1.0 - self.setting.direction * along / np.maximum(view.speed, 3.0), -1.0, 2.5)
        return -(against * np.abs(against) - 1.0) * view.drag_force * np.clip(view.speed / 3.0, 0.0, 1.0)


@law("z_spray_fills_the_wake", needs="highway", name="drafting", accepts="drag_area", leader=True)
@sizes(most=(0.85, 0.98), reach_m=(140.0, 240.0), takes=(0.85, 1.0), thick_m=(20.0, 40.0), dries_s=(2.0, 8.0))
@sizes(mean_m=(300.0, 900.0), share=(0.35, 0.6))
class SprayFillsTheWake(OnRoad, mist=0.0):
    """`mist` of a wet road behind the leader, 1 full. His wheels throw water up, which fills his wake
    a little way behind. Whoever follows has to push it aside, and that takes most of what the wake saves.
    most: of the drag, saved right behind him; takes: of that, in the thickest mist; thick_m: where that is.
    Source: Gaylard and Duncan, Simulation of Rear Glass and Body Side Vehicle Soiling, SAE 2011-01-0173, on
    how far spray is carried, and Hucho, Aerodynamics of Road Vehicles (1998); sizes are chosen here."""

    def prepare(self) -> None:
        self.road = windows(self.rng(1702), self.rows(), self.p.mean_m, self.p.share)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        gap = np.clip(self.gap(view), 0.0, 1e4)
        s.mist = eased(s.mist, self.between(self.road, view), p.dries_s, dt)
        thick = gap / p.thick_m * np.exp(1.0 - gap / p.thick_m)
        saved = p.most / (1.0 + gap / p.reach_m) ** 2
        return saved * (1.0 - p.takes * s.mist * thick) * view.drag_force * moving(view)


@law("z_boom_swings_out", needs="hills highway suburban", name="drag_area", accepts="headwind")
@sizes(more=(1.2, 1.9), frees=(0.04, 0.09), swings_s=(1.0, 3.0), homes=(0.06, 0.14), tightest=(0.008, 0.016))
class BoomSwingsOut(Bends):
    """`angle` of a folded boom whose turntable is not locked, -1 and 1 across the truck. Bends swing it out
    against the rust of its bearing, and it stays where it was left. The wind of driving turns it back only
    where that is stronger than the rust. more: of the drag, across; frees: g that rust holds; homes: g
    of that wind, at 20 m/s.
    Source: Hoerner, Fluid-Dynamic Drag (1965), on struts across a stream, and makers' manuals of loading
    cranes and concrete pumps on locking booms for the road; rust and sizes are chosen here."""

    def prepare(self) -> None:
        self.bend = self.draw_bends(self.rng(1703), self.p.tightest)

    def start(self, batch: int) -> dict[str, Array]:
        return {"angle": self.rng(1704).uniform(-1.0, 1.0, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        bend = self.setting.direction * self.read(self.bend, view)
        fast = np.minimum((view.speed / 20.0) ** 2, 2.0)
        pushes = np.clip(bend * view.speed**2, -4.0, 4.0) / 9.81
        pushes = pushes * np.sqrt(np.maximum(1.0 - s.angle**2, 0.0)) - p.homes * fast * s.angle
        over = np.sign(pushes) * np.maximum(np.abs(pushes) - p.frees, 0.0)
        s.angle = np.clip(s.angle + dt * np.clip(over / 0.1, -1.5, 1.5) / p.swings_s, -1.0, 1.0)
        return -p.more * np.sin(0.5 * np.pi * s.angle) ** 2 * view.drag_force
