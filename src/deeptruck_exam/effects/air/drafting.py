"""Less drag behind a leader."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, eased, index, moving
from deeptruck_exam.effects.places import Bends, OnRoad, windows
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_exam.effects.series import ou_series
from deeptruck_model.trucks import View

law = partial(hidden, name="drafting", accepts="drag_area headwind", leader=True)


@law("drafting", "first", "highway")
@sizes(saving=(0.30, 0.55), length_m=(16.0, 35.0), power=(1.0, 1.6))
class Slipstream(Hidden):
    """Source: Zabat, Stabile, Farascaroli and Browand, The Aerodynamic Performance of Platoons,
    UCB-ITS-PRR-95-35 (1995): saving falls off with gap over vehicle length; the rational form is chosen
    here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        at = self.now(view)
        gap = self.setting.leader_m[:, at] - view.distance
        saving = p.saving / (1.0 + (np.maximum(gap, 1.0) / p.length_m) ** p.power)
        return np.nan_to_num(saving) * view.drag_force


@law("far_wake", "second", "highway")
@sizes(deficit=(0.45, 0.7), length_m=(8.0, 16.0), miss=(0.1, 0.4), wander_s=(15.0, 40.0))
class FarWake(Hidden):
    """The leader of some seconds ago made the air that the truck meets now.
    Source: Schlichting, Boundary-Layer Theory, ch. 24: velocity deficit of an axisymmetric turbulent wake
    with the power -2/3 of distance, carried at the leader's speed; meandering of the wake is chosen here."""

    def prepare(self) -> None:
        rng, batch = self.rng(102), self.setting.batch
        self.leader_mps = np.gradient(self.setting.leader_m, self.setting.dt, axis=1)
        self.phase = rng.uniform(0.0, 2.0 * np.pi, (batch, 2))

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        last = self.leader_mps.shape[1] - 1
        now = min(int(view.time / self.setting.dt), last)
        gap = np.maximum(np.nan_to_num(self.setting.leader_m[:, now] - view.distance, nan=1e6), 1.0)
        late = gap / np.maximum(view.speed, 3.0) / self.setting.dt
        then = np.clip(now - late, 0, last).astype(int)
        wake = self.leader_mps[np.arange(len(gap)), then]
        turn = 2.0 * np.pi * view.time / p.wander_s
        met = np.sin(turn + self.phase[:, 0]) + np.sin(0.41 * turn + self.phase[:, 1])
        hits = 1.0 - p.miss * np.clip(met, 0.0, 1.0)
        deficit = p.deficit * hits * (1.0 + gap / p.length_m) ** (-2.0 / 3.0)
        dragged = np.nan_to_num(np.clip(deficit * wake, 0.0, view.speed))
        return view.drag_force * (1.0 - (1.0 - dragged / np.maximum(view.speed, 1.0)) ** 2)


@law("pocket_behind_leader", "third", "highway")
@sizes(saving=(0.45, 0.70), best_m=(12.0, 22.0), smallest=(0.35, 0.8), fills_s=(1.0, 4.0))
class PocketBehindLeader(Hidden, saving=0.0):
    """smallest: saving behind the smallest leader over that behind the largest.
    Source: McAuliffe, Lammert, Lu, Shladover, Surcel and Kailas, Influences on Energy Savings of Heavy Trucks
    Using Cooperative Adaptive Cruise Control, SAE 2018-01-1181: the saving is largest at a gap and falls to
    both sides; its shape, and leaders of all sizes, are chosen here."""

    def prepare(self) -> None:
        self.leader = self.rng(202).uniform(self.p.smallest, 1.0, self.setting.batch)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        at = self.now(view)
        gap = np.nan_to_num(self.setting.leader_m[:, at] - view.distance, nan=1e4)
        near = np.clip(gap, 0.5, 1e4) / p.best_m
        wanted = p.saving * self.leader * near * np.exp(1.0 - near)
        s.saving += dt * (wanted - s.saving) / p.fills_s
        return s.saving * view.drag_force


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


@law("pocket_lost_and_found", "sixth", "highway")
@sizes(saving=(0.45, 0.7), finds_m=(19.0, 28.0), wider=(1.12, 1.4), settles_s=(0.8, 3.0))
class PocketLostAndFound(Hidden, found=0.0, inside=0.0):
    """Whether a gap saves anything depends on where the follower came from. wider: where it is lost, over
    where it is found.
    Source: Hammache, Michaelian and Browand, Aerodynamic Forces on Truck Models, Including Two Trucks in
    Tandem, SAE 2002-01-0530: flow between bodies changes over at a critical gap, not little by little; that
    it is lost farther off than it is found again, and the sizes, are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        gap = self.gap(view)
        lost = gap > p.finds_m * p.wider
        s.found = np.where(gap < p.finds_m, 1.0, np.where(lost, 0.0, s.found))
        s.inside += dt * (s.found - s.inside) / p.settles_s
        return p.saving * s.inside * view.drag_force


@law("wake_takes_its_time", "seventh", "highway")
@sizes(drawn=(0.32, 0.55), best_m=(11.0, 19.0), narrow=(0.8, 1.6), runs=(0.3, 0.6))
class WakeTakesItsTime(Hidden):
    """The air that is met was drawn along by the leader as fast as he was then. drawn: of the leader's speed,
    at the best gap; runs: speed of the wake's eddies over the leader's.
    Source: Lammert and others, Effect of Platooning on Fuel Consumption of Class 8 Vehicles Over a Range of
    Speeds, Following Distances, and Mass, SAE 2014-01-2438: the saving is largest at a middle gap and less
    nearer; that air drawn along needs gap over speed to arrive, is chosen here."""

    def prepare(self) -> None:
        self.leader_mps = np.gradient(self.setting.leader_m, self.setting.dt, axis=1)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        one = self.setting
        gap = np.maximum(self.gap(view), 1.0)
        late = gap / np.maximum(p.runs * view.speed, 3.0) / one.dt
        then = np.clip(self.now(view) - np.minimum(late, 200.0), 0.0, None).astype(int)
        leader = np.nan_to_num(self.leader_mps[np.arange(len(gap)), then])
        shape = (gap / p.best_m * np.exp(1.0 - gap / p.best_m)) ** p.narrow
        share = np.clip(p.drawn * shape * leader / np.maximum(view.speed, 2.0), 0.0, 0.7)
        return (1.0 - (1.0 - share) ** 2) * view.drag_force


@law("s_wake_has_to_form", "eighth", "highway")
@sizes(saving=(0.45, 0.7), reach_m=(25.0, 50.0), forms_m=(60.0, 250.0), breaks_mps=(0.8, 2.5))
class WakeHasToForm(Hidden, formed=0.0):
    """breaks_mps: change of gap in a second that breaks it. It forms again over the way.
    Source: Le Good, Resnick, Boardman and Clough, Effects on the Aerodynamic Characteristics of Vehicles in
    Longitudinal Proximity, SAE 2018-37-0018, on steady pairs; the loss when gaps change is chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"formed": np.full(batch, 0.5), "gap": np.full(batch, np.nan)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        gap = self.gap(view)
        s.gap = np.where(np.isnan(s.gap), gap, s.gap)
        s.gap = s.gap + dt * (gap - s.gap) / 0.8
        broken = np.clip(np.abs(gap - s.gap) / 0.8 / p.breaks_mps - 0.5, 0.0, 1.0)
        forms = np.maximum(view.speed, 0.0) * (1.0 - s.formed) / p.forms_m - broken * s.formed / 1.5
        s.formed = np.clip(s.formed + dt * forms, 0.0, 1.0)
        return p.saving * s.formed * np.exp(-((gap / p.reach_m) ** 2)) * view.drag_force


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


@law("e_rank_in_the_column", "eleventh", "highway")
@sizes(deficit=(0.35, 0.5), length_m=(10.0, 22.0), apart_m=(18.0, 40.0), changes_s=(15.0, 50.0))
class RankInTheColumn(Hidden, ranked=1.0):
    """The leader is the last of one to five in a row, of whom some leave and others join; their wakes add up
    by squares. deficit: of the wind of driving, right behind one; length_m: over which a wake is mixed.
    Source: Katic, Højstrup and Jensen, A Simple Model for Cluster Efficiency, European Wind Energy Conference
    (1986), on wakes that add by squares; who drives farther back saves more (Davila, Aramburu and
    Freixas, Making the Best Out of Aerodynamics: Platoons, SAE 2013-01-0767); sizes are chosen here."""

    def prepare(self) -> None:
        rng, shape = self.rng(1002), (self.setting.batch, int(self.setting.duration_s) + 20)
        self.ranks = np.empty(shape)
        for row in self.ranks:
            turns = rng.random(shape[1]) < 1.0 / self.p.changes_s
            row[:] = rng.integers(1, 6, shape[1] + 1)[np.cumsum(turns)]

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.ranked = s.ranked + dt * (self.ranks[:, index(view, self.ranks)] - s.ranked) / 3.0
        gap = np.maximum(self.gap(view), 0.0)
        squares = np.zeros(len(gap))
        for k in range(5):
            there = np.clip(s.ranked - k, 0.0, 1.0)
            squares += there / (1.0 + (gap + k * p.apart_m) / p.length_m) ** 2
        slower = np.minimum(p.deficit * np.sqrt(squares), 0.8)
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


@law("x_air_bridges_the_gap", "thirteenth", "highway")
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


@law("k_walls_keep_the_wake", "fourteenth", "highway")
@sizes(drawn=(0.6, 0.85), fills_s=(1.5, 4.0), mean_m=(300.0, 900.0), share=(0.45, 0.65), open=(0.02, 0.15))
@sizes(reach_m=(60.0, 160.0))
class WallsKeepTheWake(OnRoad, air=0.0):
    """`air` m/s that the leader has set in motion. Between walls and in galleries it cannot get out aside and
    runs along with him; in the open it is gone in a moment, and little is left behind him. drawn: of the
    leader's speed; share: of the road, that has walls; open: of the drag, saved right behind him elsewhere.
    Source: Bickel, Kuesel and King, Tunnel Engineering Handbook (1996), on air that vehicles drive through
    tunnels like pistons; walls beside an open road, sizes are chosen here."""

    def prepare(self) -> None:
        self.road = windows(self.rng(1402), self.rows(), self.p.mean_m, self.p.share)
        self.pace = np.nan_to_num(np.gradient(self.setting.leader_m, self.setting.dt, axis=1))

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        walls, gap = self.between(self.road, view), np.clip(self.gap(view), 0.0, 1e4)
        pace = np.clip(self.pace[:, self.now(view)], 0.0, 30.0)
        wish = p.drawn * pace * walls / (1.0 + (gap / p.reach_m) ** 2)
        s.air = eased(s.air, wish, p.fills_s * (0.4 + 0.6 * walls), dt)
        still = 1.0 - np.clip(s.air / np.maximum(view.speed, 5.0), 0.0, 0.95)
        saved = 1.0 - still**2 * (1.0 - p.open / (1.0 + gap / 15.0))
        return saved * view.drag_force * moving(view)
