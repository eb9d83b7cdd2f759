"""Less drag behind a leader."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, eased, index, moving
from deeptruck_exam.effects.places import OnRoad, windows
from deeptruck_exam.effects.planting import hidden, sizes
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


@law("q_shutters_behind_the_leader", "fifteenth", "highway", accepts="drag_area")
@sizes(most=(0.7, 0.92), reach_m=(45.0, 90.0), starves=(0.5, 0.85), heats_s=(20.0, 50.0), opens_s=(3.0, 9.0))
class ShuttersBehindTheLeader(Hidden, wants=0.0, open=0.0):
    """`hot`: the radiator, that lacks air close behind a leader. At 1 the shutters of the grille open and the
    fan comes in, and most of what the leader's wake saves is gone until it is cool again. most: of the drag,
    saved right behind him; starves: of the air, that the radiator lacks there.
    Source: Lammert and others, Effect of Platooning on Fuel Consumption of Class 8 Vehicles Over a Range of
    Speeds, Following Distances, and Mass, SAE 2014-01-2438, on close following and cooling fans; shutters,
    sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "hot": self.rng(1502).uniform(0.3, 0.95, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        gap = np.clip(self.gap(view), 0.0, 1e4)
        near = 1.0 / (1.0 + (gap / p.reach_m) ** 2)
        air = (1.0 - p.starves * near) * np.clip(view.speed / 22.0, 0.1, 1.3)
        gains = 0.3 + np.clip(self.power_share(view), 0.0, 1.0)
        cools = 0.2 + air * (0.6 + 0.8 * s.open)
        s.hot = np.clip(eased(s.hot, gains / cools, p.heats_s / cools, dt), 0.0, 2.0)
        s.wants = np.where(s.hot > 1.0, 1.0, np.where(s.hot < 0.8, 0.0, s.wants))
        s.open = eased(s.open, s.wants, p.opens_s, dt)
        return p.most * near * (1.0 - 0.8 * s.open) * view.drag_force * moving(view)


@law("v_leader_folds_out_his_tail", "sixteenth", "highway", accepts="drag_area")
@sizes(most=(0.8, 0.95), reach_m=(60.0, 120.0), takes=(0.85, 0.98), out_mps=(22.8, 24.4), in_mps=(20.0, 22.3))
@sizes(sure_s=(1.0, 3.0), folds_s=(2.0, 5.0))
class LeaderFoldsOutHisTail(Hidden, tail=0.0):
    """`tail`: of the flaps at the leader's rear, which fold out by themselves above one speed and in again
    below another. Out, they narrow his wake and little is saved behind him. most: of the drag, right behind
    him; takes: of that, with flaps out; sure_s: how long a speed has to last.
    Source: Stemco, TrailerTail AutoDeploy, on flaps that unfold at 45 mph, and Salari and Ortega,
    Aerodynamic Design Criteria for Class 8 Heavy Vehicles, LLNL-TR-464265 (2010); sizes are chosen here."""

    def prepare(self) -> None:
        self.pace = np.clip(
            np.nan_to_num(np.gradient(self.setting.leader_m, self.setting.dt, axis=1)), 0.0, 35.0
        )

    def start(self, batch: int) -> dict[str, Array]:
        fast = np.resize(self.pace[:, 0], batch)
        return {**super().start(batch), "felt": fast, "wants": (fast > self.p.out_mps).astype(float)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.felt = eased(s.felt, self.pace[:, self.now(view)], p.sure_s, dt)
        s.wants = np.where(s.felt > p.out_mps, 1.0, np.where(s.felt < p.in_mps, 0.0, s.wants))
        s.tail = np.clip(s.tail + dt * np.where(s.wants > 0.5, 1.0, -1.0) / p.folds_s, 0.0, 1.0)
        gap = np.clip(self.gap(view), 0.0, 1e4)
        return p.most * np.exp(-gap / p.reach_m) * (1.0 - p.takes * s.tail) * view.drag_force * moving(view)


@law("z_spray_fills_the_wake", "seventeenth", "highway", accepts="drag_area")
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


@law("y_wake_dies_by_the_clock", "eighteenth", "highway")
@sizes(most=(0.8, 0.97), virtual_s=(1.5, 3.0), power=(1.0, 1.4), settles_s=(0.4, 1.2))
class WakeDiesByTheClock(Hidden, at=0.0, saved=0.0):
    """The wake of a leader dies by the time since he was here, however far he has got. `at`: the sample at
    which he was here. So the same gap saves more at high speed than at low speed. most: of the drag, saved
    just behind him; virtual_s: of age that a wake is born with; settles_s: of the flow round the follower.
    Source: Batchelor, The Theory of Homogeneous Turbulence (1953), on energy that falls with a power of its
    age; the age of a wake is that of its turbulence, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        way, row = self.setting.leader_m, np.arange(len(view.distance))
        last = way.shape[1] - 1
        now = s.at.astype(int)
        s.at = np.where(way[row, np.minimum(now + 1, last)] < view.distance, np.minimum(now + 1, last), now)
        here = s.at.astype(int)
        pace = np.maximum((way[:, min(9, last)] - way[:, 0]) / (min(9, last) * self.setting.dt), 3.0)
        before = np.maximum(way[row, here] - view.distance, 0.0) / pace  # he started ahead of this place
        age = np.nan_to_num(view.time - here * self.setting.dt + before, nan=1e4)
        wish = p.most * (1.0 + np.clip(age, 0.0, 1e4) / p.virtual_s) ** -p.power
        s.saved = eased(s.saved, wish, p.settles_s, dt)
        return s.saved * view.drag_force * moving(view)
