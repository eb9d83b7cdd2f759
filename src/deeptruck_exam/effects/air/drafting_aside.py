"""Less drag behind a leader whose wake goes another way or height, is carried off or turns narrow."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, eased, index, moving
from deeptruck_exam.effects.places import Bends
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_exam.effects.series import SAMPLE_S, ou_series
from deeptruck_model.trucks import View

law = partial(hidden, name="drafting", accepts="drag_area headwind", leader=True)


@law("out_of_the_slot", "fourth", "highway")
@sizes(saving=(0.50, 0.75), level_m=(9.0, 16.0), fades_m=(35.0, 70.0), half_width_m=(0.9, 1.9))
@sizes(steers_s=(8.0, 25.0))
class OutOfTheSlot(Hidden):
    """Whoever drifts half a lane to see past the leader is out of the slot.
    Source: Track tests of platoons (Lammert, Duran, Diez, Burton and Nicholson, SAE 2014-01-2438; McAuliffe
    and others, NRC LTR-AL-2017-0008): saving level at short gaps, then exponential in gap, less with lateral
    offset and in a cross wind; offsets of human steering and sizes are chosen here."""

    def prepare(self) -> None:
        rng, batch = self.rng(303), self.setting.batch
        samples = int(self.setting.duration_s / 0.5) + 4
        wander = 0.45 * ou_series(rng, (batch, samples), 0.5, self.p.steers_s)
        offset = np.abs(wander + rng.normal(0.0, 0.3, (batch, 1)))
        self.hits = np.exp(-((offset / self.p.half_width_m) ** 2)) * rng.uniform(0.85, 1.0, (batch, 1))

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        at = self.now(view)
        gap = np.nan_to_num(self.setting.leader_m[:, at] - view.distance, nan=1e4)
        fades = np.exp(-np.maximum(gap - p.level_m, 0.0) / p.fades_m)
        return p.saving * fades * self.hits[:, int(view.time / 0.5)] * view.drag_force


@law("wake_blown_aside", "fifth", "highway")
@sizes(saving=(0.45, 0.7), reach_m=(80.0, 170.0), side_mps=(0.5, 2.5), wide_m=(2.2, 4.5))
class WakeBlownAside(Hidden):
    """The farther the leader, the less side wind it takes.
    Source: Instrumented pairs of trucks on motorways: saving falls with the logarithm of the gap and is gone
    where a side wind has carried the wake off the follower (McAuliffe and others, SAE 2020-01-0679, on real
    traffic and cross wind); side winds and sizes are chosen here."""

    def prepare(self) -> None:
        rng, batch = self.rng(402), self.setting.batch
        slots = int(self.setting.duration_s / 0.5) + 6
        mean = rng.normal(0.0, 1.0, (batch, 1))
        self.side = self.p.side_mps * (mean + 0.6 * ou_series(rng, (batch, slots), 0.5, 20.0))

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        at = self.now(view)
        gap = np.nan_to_num(self.setting.leader_m[:, at] - view.distance, nan=1e5)
        near = np.log(p.reach_m / np.clip(gap, 6.0, p.reach_m)) / np.log(p.reach_m / 6.0)
        side = self.side[:, index(view, self.side, 0.5)]
        carried = np.minimum(gap, 300.0) * side / np.maximum(view.speed, 5.0)
        return p.saving * near / (1.0 + (carried / p.wide_m) ** 4) * view.drag_force


@law("n_wake_goes_straight_on", "ninth", "highway")
@sizes(deficit=(0.75, 0.95), widens=(0.015, 0.04), tightest=(0.004, 0.010), beside_m=(0.3, 1.3))
class WakeGoesStraightOn(Bends):
    """It leaves the follower where the road bends, and in part where the leader drives beside his track.
    widens: m of radius for each m of way.
    Source: Jensen, A Note on Wind Generator Interaction, Risø-M-2411 (1983): a wake of one speed that widens
    and keeps its momentum; a truck's radius, bends and sizes are chosen here."""

    radius_m, half_width_m = 1.4, 1.25

    def prepare(self) -> None:
        rng = self.rng(902)
        self.bend = self.draw_bends(rng, self.p.tightest)
        self.beside = rng.normal(0.0, self.p.beside_m, self.setting.batch)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        gap = np.maximum(self.gap(view), 0.0)
        radius = self.radius_m + p.widens * gap
        aside = np.abs(self.beside + 0.5 * self.read(self.bend, view) * gap**2)
        cover = np.clip((radius + self.half_width_m - aside) / (2.0 * self.half_width_m), 0.0, 1.0)
        slower = p.deficit * (self.radius_m / radius) ** 2 * cover
        return (1.0 - (1.0 - slower) ** 2) * view.drag_force


@law("t_beside_the_wake", "tenth", "highway")
@sizes(deficit=(0.7, 0.95), widens=(0.012, 0.03), wanders_m=(0.25, 0.8), swings_s=(4.0, 14.0))
class BesideTheWake(Hidden):
    """Who follows wanders in his lane, out of the middle of the wake and back. widens: m for each m of gap.
    Source: Bastankhah and Porté-Agel, A New Analytical Model for Wind-Turbine Wakes, Renewable Energy 70
    (2014): the deficit is a bell across the wake, which widens with the way; a truck's width and wandering
    are chosen here."""

    core_m = 1.2

    def prepare(self) -> None:
        rng, p = self.rng(952), self.p
        shape = (self.setting.batch, int(self.setting.duration_s / 0.1) + 20)
        habit = 0.5 * p.wanders_m * rng.standard_normal((shape[0], 1))
        self.aside = habit + p.wanders_m * ou_series(rng, shape, 0.1, p.swings_s)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        wide = self.core_m + p.widens * np.maximum(self.gap(view), 0.0)
        aside = self.aside[:, index(view, self.aside, 0.1)]
        slower = p.deficit * (self.core_m / wide) ** 2 * np.exp(-0.5 * (aside / wide) ** 2)
        return (1.0 - (1.0 - slower) ** 2) * view.drag_force


@law("w_wake_meanders", "twelfth", "highway")
@sizes(deficit=(0.6, 0.8), wide_m=(1.5, 2.2), opens=(0.015, 0.035), sways=(0.05, 0.10), slow_s=(4.0, 12.0))
class WakeMeanders(Hidden):
    """Slow eddies carry each piece of the wake aside after the leader has left it there, so that a follower
    far behind is in and out of it. deficit: of the wind of driving, right behind; opens: m of width for each
    metre; sways: m aside for each metre.
    Source: Larsen, Madsen, Thomsen and Larsen, Wake Meandering: A Pragmatic Approach, Wind Energy 11 (2008):
    the wake is a passive tracer of large eddies; a truck's wake, sizes are chosen here."""

    def prepare(self) -> None:
        shape = (self.setting.batch, int(self.setting.duration_s / 0.1) + 20)
        self.aside = ou_series(self.rng(1102), shape, 0.1, self.p.slow_s)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        gap = np.clip(self.gap(view), 0.0, 1e4)
        width = p.wide_m + p.opens * gap
        centre = p.sways * np.minimum(gap, 300.0) * self.aside[:, index(view, self.aside, 0.1)]
        slower = p.deficit * (p.wide_m / width) ** 2 * np.exp(-0.5 * (centre / width) ** 2)
        return (1.0 - (1.0 - slower) ** 2) * view.drag_force


@law("h_oncoming_trucks_sweep_it_off", "nineteenth", "highway")
@sizes(most=(0.8, 0.97), reach_m=(90.0, 180.0), every_s=(7.0, 18.0), takes=(0.6, 0.95), back_m=(0.8, 1.8))
class OncomingTrucksSweepItOff(Hidden, wake=1.0, saved=0.0):
    """`wake`: of a leader's wake that is whole. Trucks come towards both on the other lane, and each carries
    most of the wake off, the more the larger it is. The leader draws a new one, which has come back to the
    follower by the time that he has driven the gap between them. most: of the drag, saved right behind him;
    takes: of the wake, at most; back_m: gaps that he drives until the wake is back.
    Source: Baker, The Flow around High Speed Trains, J. Wind Eng. Ind. Aerodyn. 98 (2010), on gusts of what
    passes, and Hucho, Aerodynamics of Road Vehicles (1998), on wakes; sizes are chosen here."""

    def prepare(self) -> None:
        rng, batch = self.rng(1902), self.setting.batch
        samples = int(self.setting.duration_s / SAMPLE_S) + 8
        comes = rng.random((batch, samples)) < SAMPLE_S / self.p.every_s
        self.size = comes * rng.uniform(0.3, 1.0, (batch, samples))

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        gap = np.clip(self.gap(view), 3.0, 1e4)
        sweeps = p.takes * self.size[:, index(view, self.size, SAMPLE_S)] / SAMPLE_S
        back = np.maximum(view.speed, 0.0) / (p.back_m * gap)
        s.wake = np.clip(s.wake + dt * (back * (1.0 - s.wake) - 2.0 * sweeps * s.wake), 0.0, 1.0)
        s.saved = eased(s.saved, p.most * s.wake / (1.0 + (gap / p.reach_m) ** 2), 0.5, dt)
        return s.saved * view.drag_force * moving(view)


@law("b_round_tank_ahead", "twentieth", "highway hills")
@sizes(
    most=(0.8, 0.97), reach_m=(120.0, 220.0), narrow=(0.05, 0.2), flips_mps=(17.0, 21.5), holds=(0.03, 0.09)
)
@sizes(turns_s=(0.8, 2.5))
class RoundTankAhead(Hidden, narrow=0.0, saved=0.0):
    """The leader carries a round tank. Beyond one speed the flow clings to it, all at once, and its wake is
    `narrow` and saves little; it turns wide again at a somewhat lower speed. Only the leader's own speed
    counts. most: of the drag, saved right behind a wide wake; narrow: of that; flips_mps: where it turns
    narrow; holds: of that speed, lower where it turns back.
    Source: Schewe, On the Force Fluctuations Acting on a Circular Cylinder in Crossflow, J. Fluid Mechanics
    133 (1983), on two states of the flow and what keeps each; a smooth tank, sizes are chosen here."""

    def pace(self, view: View) -> Array:
        """The leader's speed over the last second, m/s."""
        way, ago = self.setting.leader_m, round(1.0 / self.setting.dt)
        now = max(self.now(view), min(ago, way.shape[1] - 1))
        before = max(now - ago, 0)
        return np.nan_to_num((way[:, now] - way[:, before]) / max((now - before) * self.setting.dt, 0.1))

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        pace = self.pace(view)
        back = p.flips_mps * (1.0 - p.holds)
        wish = np.where(pace > p.flips_mps, 1.0, np.where(pace < back, 0.0, np.rint(s.narrow)))
        s.narrow = eased(s.narrow, wish, p.turns_s, dt)
        near = 1.0 / (1.0 + (np.clip(self.gap(view), 3.0, 1e4) / p.reach_m) ** 2)
        s.saved = eased(s.saved, p.most * near * (1.0 - (1.0 - p.narrow) * s.narrow), 0.6, dt)
        return s.saved * view.drag_force * moving(view)


@law("u_wake_misses_in_sags", "twenty-first", "hills highway")
@sizes(most=(0.75, 0.95), reach_m=(110.0, 200.0), high_m=(0.25, 0.6), along_m=(25.0, 45.0))
class WakeMissesInSags(Hidden, slope=9.0, saved=0.0):
    """A leader's wake keeps to the slope that he drives on. In a sag he is already climbing, so that it goes
    below the follower, and over a crest above: by the bend of the road up or down, and the square of the gap.
    most: of the drag, saved right behind him on an even slope; high_m: by which it may miss; along_m: over
    which the bend is taken.
    Source: Hucho, Aerodynamics of Road Vehicles (1998), on wakes, and AASHTO, A Policy on Geometric Design
    (2018), on vertical curves; sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.5)
        s.slope = np.where(s.slope > 1.0, view.grade, eased(s.slope, view.grade, p.along_m / speed, dt))
        gap = np.clip(self.gap(view), 3.0, 1e4)
        misses = 0.5 * (view.grade - s.slope) / p.along_m * np.minimum(gap, 250.0) ** 2
        meets = np.exp(-np.minimum((misses / p.high_m) ** 2, 30.0))
        s.saved = eased(s.saved, p.most * meets / (1.0 + (gap / p.reach_m) ** 2), 0.6, dt)
        return s.saved * view.drag_force * moving(view)
