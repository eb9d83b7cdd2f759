"""A valley's wind that turns about, a gap that air closes or leaves open, and a blade that is raised."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, index, moving
from deeptruck_exam.effects.places import CELL_M, OnRoad, sections, smooth_stretches
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_exam.effects.series import ou_series
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")


@law("x_valley_turns_the_wind", needs="highway hills", name="headwind", accepts="drag_area")
@sizes(aloft_mps=(12.0, 18.0), veers_s=(90.0, 260.0), veers=(0.6, 1.1), flows_s=(4.0, 14.0), bends=(0.3, 0.7))
@sizes(mean_m=(900.0, 2500.0))
class ValleyTurnsTheWind(OnRoad, flow=0.0):
    """`flow` of the air along a valley, over the wind aloft. It follows the axis towards the side that the
    wind aloft leans to, so that it turns right about when that wind veers a little across the axis. veers:
    rad, of the wind aloft; bends: rad, of the axis from one reach to the next.
    Source: Whiteman and Doran, The Relationship between Overlying Synoptic-Scale Flows and Winds within a
    Valley, J. Applied Meteorology 32 (1993): forced channelling; quicker winds, sizes are chosen here."""

    def prepare(self) -> None:
        rng, batch = self.rng(1301), self.setting.batch
        number = sections(rng, self.rows(), self.p.mean_m)
        turns = self.p.bends * rng.standard_normal((self.rows(), int(number.max()) + 1))
        self.axis = np.take_along_axis(turns, number, axis=1)
        shape = (batch, int(self.setting.duration_s) + 5)
        self.aloft = 0.5 * np.pi + self.p.veers * ou_series(rng, shape, 1.0, self.p.veers_s)
        self.gusts = 1.0 + 0.15 * ou_series(rng, shape, 1.0, 3.0)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        k = index(view, self.aloft)
        leans = np.cos(self.aloft[:, k] - self.read(self.axis, view))
        wants = np.sign(leans) * np.sqrt(np.abs(leans))
        s.flow = s.flow + dt * (wants - s.flow) / p.flows_s
        wind = self.setting.direction * p.aloft_mps * s.flow * self.gusts[:, k]
        relative = np.clip(1.0 + wind / np.maximum(view.speed, 0.5), -1.5, 3.0)
        felt = (relative * np.abs(relative) - 1.0) * view.drag_force
        return -felt * np.clip(view.speed / 3.0, 0.0, 1.0)


@law("x_air_bridges_the_gap", needs="highway", name="drafting", accepts="drag_area headwind", leader=True)
@sizes(bridged=(0.8, 0.95), open=(0.0, 0.15), half_m=(26.0, 45.0), flips_s=(3.0, 9.0), forms_s=(0.6, 2.0))
@sizes(sharp=(2.0, 5.0))
class AirBridgesTheGap(Hidden, last=-1.0, bridges=0.0, air=0.0):
    """The air that leaves the leader either lands on the truck and bridges the gap, or falls into it. Which
    of both is a matter of chance, and of distance. bridged, open: of the drag saved; half_m: where both are
    as likely; flips_s: how often the air may change its mind.
    Source: Martinuzzi and Havel, Turbulent Flow around Two Interfering Surface-Mounted Cubic Obstacles in
    Tandem Arrangement, J. Fluids Engineering 122 (2000): two regimes that alternate; sizes are chosen
    here."""

    def prepare(self) -> None:
        shape = (self.setting.batch, int(self.setting.duration_s / 0.5) + 20)
        self.dice = self.rng(1302).random((2, *shape))

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        gap = np.clip(self.gap(view), 0.5, 1e4)
        chance = 1.0 / (1.0 + (gap / p.half_m) ** (2.0 * p.sharp))
        k = index(view, self.dice[0], 0.5)
        thrown = (s.last < k) & (self.dice[0][:, k] < 0.5 / p.flips_s)
        s.bridges = np.where(thrown | (s.last < 0.0), self.dice[1][:, k] < chance, s.bridges)
        s.last = np.full_like(s.last, k)
        s.air = s.air + dt * (s.bridges - s.air) / p.forms_s
        near = 1.0 / (1.0 + (gap / (6.0 * p.half_m)) ** 2)
        saved = near * (p.open + (p.bridged - p.open) * s.air)
        return np.clip(saved * 1.15, 0.0, 0.92) * view.drag_force


@law("x_blade_is_raised", needs="highway hills", name="drag_area", accepts="headwind")
@sizes(most=(2.0, 3.4), up_s=(18.0, 45.0), down_s=(12.0, 30.0), apart_m=(500.0, 1500.0), flat=(0.0, 0.1))
class BladeIsRaised(OnRoad, angle=0.0):
    """`angle` of a wind turbine's blade on its lifter, over the steepest: raised before narrow places,
    slowly, and laid down behind them. It stands across the wind with the square of its sine. most: of the
    drag, more when steepest; flat: of that, laid down.
    Source: Makers' manuals of blade lifters for self-propelled and towed modules (Goldhofer FTV), on raising
    to 60 degrees in passages, and Hoerner, Fluid-Dynamic Drag (1965), on inclined bodies across a stream;
    places and sizes are chosen here."""

    def prepare(self) -> None:
        gaps = (0.4 * self.p.apart_m, 1.6 * self.p.apart_m)
        narrow = smooth_stretches(self.rng(1303), self.rows(), gaps, (400.0, 1300.0))
        self.road = np.where(narrow > 0.2, 1.0, 0.0)

    def start(self, batch: int) -> dict[str, Array]:
        return {"angle": self.rng(1304).uniform(0.0, 0.5, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        ahead = (self.place(view) + self.setting.direction * 150.0) / CELL_M
        cell = ahead.astype(int) % self.road.shape[1]
        wants = self.road[self.setting.route, cell]
        s.angle = np.clip(s.angle + dt * np.where(wants > 0.5, 1.0 / p.up_s, -1.0 / p.down_s), 0.0, 1.0)
        across = np.sin(0.5 * np.pi * s.angle) ** 2
        return -p.most * (p.flat + (1.0 - p.flat) * across) * view.drag_force * moving(view)
