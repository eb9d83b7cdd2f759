"""Shifts that wait for a foot, for torque to let go, for the engine, or for a speed that runs away."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, eased, moving, weight
from deeptruck_exam.effects.places import OnRoad, sections
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, name="shift_interruption")
GEARS = 20


@law("foot_after_the_lever", "sixth", "suburban hills")
@sizes(hand_s=(0.2, 0.6), foot_s=(0.5, 1.1), spread=(0.3, 0.6), hurries=(5.0, 20.0))
class FootAfterTheLever(Hidden):
    """The simulator knows the lever, not the foot. hurries: faster, for each unit of slope.
    Source: People who change gears by hand come back to the pedal late and softly, no two times alike (AAMVA
    Commercial Driver License Manual, on shifting gears; log-normal response times: Luce, Response Times,
    1986), and hurry uphill; torque returns as a bell's flank; times are chosen here."""

    def prepare(self) -> None:
        dice = self.rng(512).standard_normal((self.setting.batch, 256))
        self.habit = np.exp(self.p.spread * np.clip(dice, -2.0, 2.0))

    def start(self, batch: int) -> dict[str, Array]:
        return {"gear": np.zeros(batch), "since": np.full(batch, 1e3), "count": np.zeros(batch, int)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        changed = (view.gear != s.gear) & (s.gear > 0.0) & (view.speed > 1.0)
        s.count = (s.count + changed) % 256
        s.since = np.where(changed, 0.0, s.since + dt * (1.0 - view.shifting))
        s.gear = view.gear.copy()
        pace = self.habit[np.arange(len(s.count)), s.count] / (1.0 + p.hurries * np.maximum(view.grade, 0.0))
        back = np.maximum(s.since - p.hand_s * pace, 0.0) / (p.foot_s * pace)
        return -np.exp(-(back**2)) * np.maximum(view.traction_force, 0.0) * moving(view)


@law("e_gear_is_held_fast", "eleventh", "suburban hills", trucks="trucksim volvo")
@sizes(per_pull_s=(2.5, 6.0), tries_s=(0.15, 0.4), returns_s=(0.3, 0.8), feels_s=(0.25, 0.6))
class GearIsHeldFast(Hidden, gear=0.0, pull=0.0, before=0.0, left=0.0, share=1.0):
    """Teeth that are pressed do not let go of their gear: the harder the pull before a change, the longer
    until the next gear drives. per_pull_s: for a pull of a tenth of the weight, which is as much as it bears
    in a low gear.
    Source: Bóka, Márialigeti, Lovas and Trencséni, Face Dog Clutch Engagement at Low Mismatch Speed,
    Periodica Polytechnica Transportation Engineering 38 (2010), on dogs of automated truck gearboxes, and
    shafts that have to unwind before; times are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        open_, pull = view.shifting > 0.0, np.abs(view.traction_force) / weight(view)
        changed = (view.gear != s.gear) & (s.gear > 0.0) & (view.speed > 1.0)
        s.gear = view.gear.copy()
        s.before = np.where(open_, s.before, s.before + dt * (pull - s.before) / p.feels_s)
        needs = p.tries_s + p.per_pull_s * np.clip(s.before / 0.1, 0.0, 1.0) ** 1.5
        s.left = np.where(changed, np.minimum(needs, 1.6), s.left - dt * ~open_)
        s.left = np.maximum(s.left, 0.0)
        s.share = np.where(s.left > 0.0, 0.0, s.share + dt * (1.0 - s.share) / p.returns_s)
        return np.asarray(-(1.0 - s.share) * np.maximum(view.traction_force, 0.0) * moving(view))


@law("w_waits_for_a_calm_foot", "twelfth", "suburban hills", trucks="trucksim volvo")
@sizes(calm=(0.05, 0.12), longest_s=(0.9, 1.6), least_s=(0.15, 0.4), closes_s=(0.25, 0.6), feels_s=(0.3, 0.7))
class WaitsForACalmFoot(Hidden, gear=0.0, foot=0.0, moves=0.0, waits=0.0, share=1.0):
    """After a change of gear the clutch closes once the pedal has come to rest, or after a longest time, so
    that a restless foot costs drive. calm: of the full pedal, moved in a second.
    Source: Glielmo, Iannelli, Vacca and Vasca, Gearshift Control for Automated Manual Transmissions,
    IEEE/ASME Trans. Mechatronics 11 (2006), on engagement by the driver's demand; times are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        pedal = self.pedal(view)
        s.foot = np.where(s.gear > 0.0, s.foot, pedal)
        lag = (pedal - s.foot) / p.feels_s
        s.foot = s.foot + dt * lag
        s.moves = s.moves + dt * (np.abs(lag) - s.moves) / p.feels_s
        changed = (view.gear != s.gear) & (s.gear > 0.0) & (view.speed > 1.0)
        s.gear = view.gear.copy()
        s.waits = np.where(changed, dt, np.where(s.waits > 0.0, s.waits + dt * (view.shifting < 0.5), 0.0))
        done = ((s.waits > p.least_s) & (s.moves < p.calm)) | (s.waits > p.longest_s)
        s.waits = np.where(done, 0.0, s.waits)
        pace = np.where(s.waits > 0.0, -1.0 / 0.08, 1.0 / p.closes_s)
        s.share = np.clip(s.share + dt * pace, 0.0, 1.0)
        return np.asarray(-(1.0 - s.share) * np.maximum(view.traction_force, 0.0) * moving(view))


@law("x_speed_runs_away_uphill", "thirteenth", "hills suburban", trucks="trucksim volvo")
@sizes(
    meets_mps=(0.10, 0.25), slow_s=(0.5, 1.0), misses=(1.0, 2.5), longest_s=(1.6, 2.6), ramps_s=(0.25, 0.6)
)
class SpeedRunsAwayUphill(Hidden, gear=0.0, open=0.0, wish=0.0, share=1.0):
    """Between two gears the computer aims at the speed that the truck had when it began. `wish` m/s: what the
    truck has lost or won since. Uphill, with much load, it falls below the aim and the gear does not go in
    until the engine has been asked again. meets_mps: off, that still goes in; misses: longer, for each m/s
    that is off.
    Source: Tseng and Yu, Advanced Shifting Control of Synchronizer Mechanisms for Clutchless Automatic Manual
    Transmission in an Electric Vehicle, Mechanism and Machine Theory 84 (2015), on synchronising a moving
    target; times are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        changed = (view.gear != s.gear) & (s.gear > 0.0) & (view.speed > 1.5)
        s.gear = view.gear.copy()
        s.open = np.where(changed, dt, np.where(s.open > 0.0, s.open + dt * (view.shifting < 0.5), 0.0))
        aside = np.minimum(np.abs(view.acceleration), 1.5) * (s.open > 0.0)
        s.wish = np.where(changed, 0.0, s.wish + dt * aside)
        needs = p.slow_s * (1.0 + p.misses * np.maximum(s.wish - p.meets_mps, 0.0))
        done = (s.open > needs) | (s.open > p.longest_s)
        s.open = np.where(done, 0.0, s.open)
        pace = np.where(s.open > 0.0, -1.0 / 0.1, 1.0 / p.ramps_s)
        s.share = np.clip(s.share + dt * pace, 0.0, 1.0)
        return np.asarray(-(1.0 - s.share) * np.maximum(view.traction_force, 0.0) * moving(view))


@law("k_splitter_follows", "fourteenth", "suburban hills", trucks="trucksim volvo")
@sizes(open_s=(0.6, 1.2), waits_s=(2.0, 5.0), light=(0.015, 0.04), ramps_s=(0.3, 0.8))
class SplitterFollows(Hidden, gear=0.0, waits=0.0, open=0.0, share=1.0):
    """A half gear was chosen along with the last change, but its claws come out only when torque lets them
    go: once the driver eases the pedal, or when the computer has lost patience, there is a second gap.
    waits_s: at the longest; light: of the weight, pull at which they come out.
    Source: Eaton Fuller, Driver Instructions of 13 and 18 speed transmissions, on splitter shifts that are
    preselected and wait for a break in torque; automated, times are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        changed = (view.gear != s.gear) & (s.gear > 0.0) & (view.speed > 1.5)
        s.gear = view.gear.copy()
        s.waits = np.where(changed, dt, np.where(s.waits > 0.0, s.waits + dt * (view.shifting < 0.5), 0.0))
        light = (view.traction_force < p.light * weight(view)) & (s.waits > 0.8)
        goes = light | (s.waits > p.waits_s)
        s.open = np.where(goes, p.open_s, np.maximum(s.open - dt, 0.0))
        s.waits = np.where(goes, 0.0, s.waits)
        s.share = np.clip(s.share + dt * np.where(s.open > 0.0, -1.0 / 0.12, 1.0 / p.ramps_s), 0.0, 1.0)
        return np.asarray(-(1.0 - s.share) * np.maximum(view.traction_force, 0.0) * moving(view))


@law("z_rough_roads_keep_it_out", "seventeenth", "suburban hills", accepts="torque_limit")
@sizes(least_s=(0.2, 0.4), more_s=(0.8, 1.6), power=(1.0, 2.0), ramps_s=(0.5, 1.1), mean_m=(150.0, 600.0))
class RoughRoadsKeepItOut(OnRoad, gear=0.0, left=0.0, gives=1.0):
    """Wheels that jump on a rough road shake the gearbox, and its control waits for a calm moment before it
    lets teeth meet. So a change takes the longer, the rougher the road and the faster the truck; on smooth
    roads it takes its usual time. least_s, more_s: without torque, on a smooth road and on a rough one more;
    power: of that with roughness.
    Source: Naunheimer, Bertsche, Ryborz and Novak, Automotive Transmissions (2011), on synchronising with a
    driveline that shakes, and ISO 8608 on classes of roughness; sizes are chosen here."""

    def prepare(self) -> None:
        rng = self.rng(1731)
        number = sections(rng, self.rows(), self.p.mean_m)
        rough = rng.uniform(0.0, 1.0, (self.rows(), int(number.max()) + 1))
        self.road = np.take_along_axis(rough, number, axis=1)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        begins = (view.gear != s.gear) & (s.gear > 0.0) & (view.speed > 0.5)
        s.gear = view.gear.copy()
        shakes = self.read(self.road, view) ** p.power * np.clip(view.speed / 10.0, 0.2, 1.5)
        s.left = np.where(begins, p.least_s + p.more_s * shakes, np.maximum(s.left - dt, 0.0))
        s.gives = np.clip(s.gives + dt * np.where(s.left > 0.0, -1.0 / 0.12, 1.0 / p.ramps_s), 0.0, 1.0)
        return -(1.0 - s.gives) * np.maximum(view.traction_force, 0.0) * moving(view)


@law("h_engine_has_to_catch_up", "nineteenth", "suburban hills", accepts="torque_limit")
@sizes(base_s=(0.9, 1.6), per_step_s=(5.5, 9.0), warm=(0.4, 0.7), forgets_s=(3.0, 8.0), deep=(0.75, 0.95))
class EngineHasToCatchUp(Hidden, gear=0.0, ratio=1.0, left=0.0, boost=0.0, cut=0.0):
    """Before a lower gear is closed the engine has to turn faster, and it gets there by its own little pull:
    the wider the step, the longer the truck rolls. `boost` of pulls of late lets it rev up quickly. Upward
    changes are as they should be. base_s: of each change down; per_step_s: more, for a doubling of the
    ratio; warm: of that time, saved by boost; deep: of the pull, lost meanwhile.
    Source: Pettersson and Nielsen, Gear Shifting by Engine Control, IEEE Trans. Control Systems Technology 8
    (2000), on synchronising by the engine; a slow engine, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        begins = (view.gear < s.gear - 0.5) & (view.speed > 0.5)
        step = np.clip(np.log2(np.maximum(view.ratio, 0.1) / np.maximum(s.ratio, 0.1)), 0.0, 1.0)
        lasts = p.base_s + p.per_step_s * step * (1.0 - p.warm * s.boost)
        s.left = np.where(begins, lasts, np.maximum(s.left - dt, 0.0))
        s.gear, s.ratio = view.gear.copy(), view.ratio.copy()
        s.boost = eased(s.boost, np.clip(1.2 * self.power_share(view), 0.0, 1.0), p.forgets_s, dt)
        s.cut = eased(s.cut, np.where(s.left > 0.0, p.deep, 0.0), 0.12, dt)
        return -s.cut * np.maximum(view.traction_force, 0.0) * moving(view)


@law("u_clutches_have_drained", "twenty-first", "suburban hills", accepts="torque_limit")
@sizes(extra_s=(1.0, 1.8), drains_s=(15.0, 45.0), cut=(0.85, 1.0), back_s=(0.1, 0.3))
class ClutchesHaveDrained(Hidden, gear=0.0, left=0.0, open=0.0):
    """Each gear has a wet clutch of its own, which drains slowly while its gear is not used. When the gear
    comes again the clutch has to be filled first, for the longer, the longer that is ago. `idle` s since each
    gear was used. extra_s: beyond the known time, for an empty clutch; cut: of the pull.
    Source: Naunheimer, Bertsche, Ryborz and Novak, Automotive Transmissions (2011), and Hebbale and Kao,
    Adaptive Control of Shifts in Automatic Transmissions, ASME DSC 57 (1995), on the filling of clutches;
    clutches that leak, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        idle = self.p.drains_s * self.rng(2132).uniform(0.0, 3.0, (batch, GEARS))
        return {**super().start(batch), "idle": idle}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        rows, now = np.arange(len(s.left)), np.clip(np.rint(view.gear), 0, GEARS - 1).astype(int)
        closes = (np.abs(view.gear - s.gear) > 0.5) & (view.shifting < 0.5) & (view.speed > 0.5)
        fills = p.extra_s * (1.0 - np.exp(-s.idle[rows, now] / p.drains_s)) * (s.gear > 0.5)
        s.left = np.where(closes, fills, np.maximum(s.left - dt, 0.0))
        s.gear = np.where(view.shifting < 0.5, view.gear, s.gear)
        s.idle = s.idle + dt
        s.idle[rows, now] = np.where(view.shifting < 0.5, 0.0, s.idle[rows, now])
        s.open = np.where(s.left > 0.0, 1.0, eased(s.open, 0.0, p.back_s, dt))
        return -p.cut * s.open * np.maximum(view.traction_force, 0.0) * moving(view)
