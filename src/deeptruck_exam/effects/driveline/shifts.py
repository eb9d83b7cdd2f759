"""Torque that is interrupted by shifts."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, eased, moving, weight
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, name="shift_interruption")
RANGE_RATIO = 3.05  # of the gearbox alone, between its low and its high range


@law("shift_interruption", "first", "suburban hills")
@sizes(hold_s=(0.3, 0.9), return_s=(0.4, 1.0))
class LateReturn(Hidden, since=99.0, gear=-1.0):
    """Source: Pettersson and Nielsen, Gear Shifting by Engine Control, IEEE Trans. Control Syst. Technol. 8
    (2000): torque held off until driveline oscillation has died; hold and raised-cosine return are chosen
    here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        changed = (s.gear >= 0.0) & (view.gear != s.gear)
        s.since = np.where(changed | (view.shifting > 0.0), 0.0, s.since + dt)
        s.gear = view.gear.copy()
        back = np.clip((s.since - p.hold_s) / p.return_s, 0.0, 1.0)
        held = 0.5 * (1.0 + np.cos(np.pi * back))
        return -held * np.maximum(view.traction_force, 0.0)


@law("clutch_meters_in", "second", "suburban hills")
@sizes(sync_s=(0.6, 1.8), metered=(0.25, 0.7), down=(1.0, 2.0))
class ClutchMetersIn(Hidden, ratio=0.0, open=0.0, carried=1000000.0):
    """sync_s: open for each unit of the logarithm of the step; metered: share of 0.1 g a second.
    Source: Friction phase of a launch clutch after a change: speed difference of the step times engine
    inertia over the clutch's slope, Naunheimer et al., Automotive Transmissions (2011), on shifting elements;
    torque returns at a metered rate, numbers chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        engaged = (view.shifting == 0.0) & (view.ratio > 0.0)
        step = np.log(np.maximum(view.ratio, 0.1) / np.where(s.ratio > 0.0, s.ratio, view.ratio + 0.1))
        changed = engaged & (s.ratio > 0.0) & (np.abs(step) > 0.02)
        wait = p.sync_s * np.abs(step) * np.where(step > 0.0, p.down, 1.0)
        s.open = np.where(changed, np.minimum(wait, 1.5), np.maximum(s.open - dt * engaged, 0.0))
        s.ratio = np.where(engaged, view.ratio, s.ratio)
        rate = p.metered * view.mass
        s.carried = np.where(s.open > 0.0, 0.0, np.minimum(s.carried + rate * dt, 1e6))
        pull = view.traction_force
        return (np.clip(pull, -s.carried, s.carried) - pull) * engaged * moving(view)


@law("dogs_miss", "third", "suburban hills")
@sizes(odds=(0.45, 0.8), again_s=(0.8, 2.2), quick_s=(0.1, 0.35), back_s=(0.25, 0.6))
class DogsMiss(Hidden):
    """Source: Dog clutches that meet tooth on tooth and are tried again (Naunheimer, Bertsche, Ryborz and
    Novak, Automotive Transmissions, 2011, on gear shifting mechanisms): most changes are quick, some are not,
    by chance; odds and times are chosen here."""

    def prepare(self) -> None:
        rng, shape = self.rng(220), (self.setting.batch, 600)
        missed = rng.random(shape) < self.p.odds
        self.wait = np.where(missed, self.p.again_s * rng.uniform(0.5, 1.3, shape), self.p.quick_s)

    def start(self, batch: int) -> dict[str, Array]:
        return {
            "gear": np.full(batch, -1.0),
            "changes": np.zeros(batch, int),
            "open": np.zeros(batch),
            "share": np.ones(batch),
        }

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        changed = (s.gear >= 0.0) & (view.gear != s.gear)
        s.gear = view.gear.copy()
        s.changes = (s.changes + changed) % self.wait.shape[1]
        wait = self.wait[np.arange(len(changed)), s.changes]
        s.open = np.where(changed, wait, np.maximum(s.open - dt * (view.shifting == 0.0), 0.0))
        s.share = np.where(s.open > 0.0, 0.0, s.share + dt * (1.0 - s.share) / p.back_s)
        return -(1.0 - s.share) * np.maximum(view.traction_force, 0.0)


@law("shifts_short_of_air", "fourth", "suburban hills")
@sizes(draws=(0.10, 0.20), refills_s=(15.0, 40.0), dwell_s=(0.15, 0.4), ramp_s=(0.5, 1.3))
class ShiftsShortOfAir(Hidden):
    """draws: of the reservoir; dwell_s: with full pressure.
    Source: Pneumatic shift cylinders of automated gearboxes fed by a small reservoir (service bulletins on
    slow shifts at low supply pressure): every change draws air, and the next is slower the sooner it comes;
    torque returns along a straight ramp; volumes and times are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        air = self.rng(331).uniform(0.6, 1.0, batch)
        return {"gear": np.full(batch, -1.0), "air": air, "wait": np.zeros(batch), "share": np.ones(batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        changed = (s.gear >= 0.0) & (view.gear != s.gear)
        s.gear = view.gear.copy()
        s.air = np.clip(s.air + dt * (1.0 - s.air) / p.refills_s - p.draws * changed, 0.4, 1.0)
        s.wait = np.where(changed, p.dwell_s / s.air**2, np.maximum(s.wait - dt, 0.0))
        s.share = np.where(s.wait > 0.0, 0.0, np.minimum(s.share + dt / p.ramp_s, 1.0))
        return -(1.0 - s.share) * np.maximum(view.traction_force, 0.0)


@law("gearbox_brake_in_cold_oil", "fifth", "suburban hills")
@sizes(per_step_s=(0.3, 0.7), down=(1.3, 2.2), returns_s=(0.5, 1.2), worn=(0.5, 1.6), warms_s=(90.0, 240.0))
class GearboxBrakeInColdOil(Hidden, gear=0.0, since=1000.0, dwell=0.0, warm=0.0):
    """per_step_s: beyond the known time of a change, for each gear that is passed. worn: longer when the oil
    is warm.
    Source: Unsynchronised automated gearboxes (Naunheimer, Bertsche, Ryborz and Novak, Automotive
    Transmissions, 2011, on central synchronisation): the countershaft has to change speed by the step,
    quickly upwards in thick oil and slowly downwards; torque returns as half a cosine; a worn gearbox brake,
    times are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        steps = view.gear - s.gear
        changed = (steps != 0.0) & (s.gear > 0.0) & (view.speed > 1.0)
        up = 1.0 + p.worn * s.warm
        pace = np.where(steps > 0.0, up, p.down)
        wait = np.minimum(p.per_step_s * np.sqrt(np.abs(steps)) * pace, 1.8)
        s.dwell = np.where(changed, wait, s.dwell)
        s.since = np.where(changed, 0.0, s.since + dt * (1.0 - view.shifting))
        s.gear = view.gear.copy()
        s.warm = s.warm + dt * (1.0 - s.warm) / p.warms_s
        back = np.clip((s.since - s.dwell) / p.returns_s, 0.0, 1.0)
        missing = 0.5 * (1.0 + np.cos(np.pi * back))
        return -missing * np.maximum(view.traction_force, 0.0) * moving(view)


@law("torque_back_by_a_ramp", "seventh", "suburban hills")
@sizes(ramp_per_s=(0.16, 0.4), waits_s=(0.1, 0.5), down_s=(0.3, 1.0))
class TorqueBackByARamp(Hidden, gear=0.0, wait=0.0, given=2.0):
    """`given` over peak torque: what the ramp has reached.
    Source: Shift quality on proving grounds (Naunheimer and others, Automotive Transmissions, 2011, on
    automated manual gearboxes): after a change torque comes back by so many newton metres a second, so that
    the more is asked the longer it takes; a downward change is matched longer."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        changed = (view.gear != s.gear) & (s.gear > 0.0) & (view.speed > 1.0)
        wait = p.waits_s + p.down_s * (view.gear < s.gear)
        s.wait = np.where(changed, wait, np.maximum(s.wait - dt * (1.0 - view.shifting), 0.0))
        s.gear = view.gear.copy()
        rises = dt * p.ramp_per_s * (s.wait <= 0.0) * (1.0 - view.shifting)
        s.given = np.where(changed, 0.05, np.minimum(s.given + rises, 2.0))
        missing = np.maximum(view.engine_torque / self.truck.peak_torque - s.given, 0.0)
        return -self.at_wheels(view, missing * self.truck.peak_torque) * moving(view)


@law("s_clutch_learns", "eighth", "suburban hills")
@sizes(hold_s=(0.3, 0.7), hot=(0.8, 2.0), cools_s=(15.0, 50.0), back_s=(0.25, 0.7))
class ClutchLearns(Hidden, gear=-1.0, hot=0.0, left=0.0, share=1.0):
    """The more changes there were of late, the longer each takes.
    Source: Myklebust and Eriksson, Modeling, Observability, and Estimation of Thermal Effects and Aging on
    Transmitted Torque in a Heavy Duty Truck with a Dry Clutch, IEEE/ASME Trans. Mechatronics 20 (2015): heat
    moves the kiss point; the time this costs is chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        changed = (s.gear >= 0.0) & (view.gear != s.gear)
        s.gear = view.gear.copy()
        s.hot = np.minimum(s.hot + 0.3 * changed, 1.5) * (1.0 - dt / p.cools_s)
        waits = p.hold_s * (1.0 + p.hot * s.hot)
        s.left = np.where(changed, waits, np.maximum(s.left - dt * (view.shifting == 0.0), 0.0))
        s.share = np.where(s.left > 0.0, 0.0, s.share + dt * (1.0 - s.share) / p.back_s)
        return -(1.0 - s.share) * np.maximum(view.traction_force, 0.0)


@law("n_range_group_is_slow", "ninth", "suburban", trucks="trucksim volvo")
@sizes(range_s=(0.6, 1.4), split_s=(0.02, 0.2), down=(1.0, 1.6), back_s=(0.4, 1.0))
class RangeGroupIsSlow(Hidden, box=0.0, left=-9.0):
    """Changes within a range are nearly as quick as known; those from one range to the other wait.
    Source: Group gearboxes with a range change behind (Naunheimer, Bertsche, Ryborz and Novak, Automotive
    Transmissions, 2011, on commercial vehicles): a large piston and a synchroniser of a large step; a worn
    one, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        engaged = (view.shifting == 0.0) & (view.ratio > 0.0)
        box = view.ratio / self.truck.final_drive
        stepped = engaged & (s.box > 0.0) & (np.abs(box - s.box) > 0.02)
        crossed = (box > RANGE_RATIO) != (s.box > RANGE_RATIO)
        wait = np.where(crossed, p.range_s * np.where(box > s.box, p.down, 1.0), p.split_s)
        s.left = np.where(stepped, wait, np.maximum(s.left - dt * engaged, -9.0))
        s.box = np.where(engaged, box, s.box)
        back = np.clip(-s.left / p.back_s, 0.0, 1.0) ** 2
        return -(1.0 - back) * np.maximum(view.traction_force, 0.0)


@law("t_engine_falls_by_itself", "tenth", "suburban hills", trucks="trucksim volvo")
@sizes(falls=(30.0, 70.0), blips=(90.0, 180.0), feels_s=(0.1, 0.4), returns_s=(0.25, 0.7))
class EngineFallsByItself(Hidden, gear=0.0, ratio=0.0, left=0.0, share=1.0):
    """No brake slows it between two gears: the wider the step and the faster the truck, the longer it takes.
    falls, blips: rad/s in a second, down by friction and up by fuel.
    Source: Fredriksson and Egardt, Active Engine Control for Gearshifting in Automated Manual Transmissions,
    Int. J. Vehicle Design 32 (2003): the engine must meet the next gear's speed before torque comes back; an
    engine left to its own friction, rates are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        changed = (view.gear != s.gear) & (s.gear > 0.0) & (view.speed > 1.0)
        step = view.speed / self.truck.wheel_radius * (s.ratio - view.ratio)
        needs = p.feels_s + np.where(step > 0.0, step / p.falls, -step / p.blips)
        s.left = np.where(changed, np.minimum(needs, 2.5), s.left - dt * (view.shifting == 0.0))
        s.left = np.maximum(s.left, 0.0)
        still = (view.shifting == 0.0) | (s.ratio == 0.0)
        s.gear, s.ratio = view.gear.copy(), np.where(still, view.ratio, s.ratio)
        back = dt * (1.0 - s.share) / p.returns_s
        s.share = np.where(s.left > 0.0, 0.0, s.share + back)
        return -(1.0 - s.share) * np.maximum(view.traction_force, 0.0) * moving(view)


@law("q_cones_get_hot", "fifteenth", "suburban hills", trucks="trucksim volvo")
@sizes(open_s=(0.5, 1.0), more=(1.0, 2.2), heats=(1.2, 2.5), cools_s=(8.0, 25.0), ramps_s=(0.3, 0.8))
class ConesGetHot(Hidden, gear=0.0, ratio=0.0, hot=0.0, open=0.0, share=1.0):
    """`hot`: the cones that bring gears to one speed. Every change heats them, a wide step at speed most, and
    hot cones rub less, so that changes one soon after the other take longer and longer. open_s: beyond the
    usual gap, cold; more: of that, hot; heats: by a step of the whole ratio at 15 m/s.
    Source: Naunheimer, Bertsche, Ryborz and Novak, Automotive Transmissions (2011), on synchronisers, their
    work of friction and temperature; worn cones, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        changed = (view.gear != s.gear) & (s.gear > 0.0) & (view.speed > 1.0)
        step = np.abs(view.ratio - s.ratio) / np.maximum(s.ratio, 0.1)
        s.open = np.where(changed, p.open_s * (1.0 + p.more * s.hot), s.open)
        heat = p.heats * np.minimum(step, 1.0) * view.speed / 15.0
        s.hot = np.minimum(np.where(changed, s.hot + heat, eased(s.hot, 0.0, p.cools_s, dt)), 1.2)
        s.gear, s.ratio = view.gear.copy(), view.ratio.copy()
        s.open = np.maximum(s.open - dt * (view.shifting < 0.5), 0.0)
        s.share = np.clip(s.share + dt * np.where(s.open > 0.0, -1.0 / 0.1, 1.0 / p.ramps_s), 0.0, 1.0)
        return np.asarray(-(1.0 - s.share) * np.maximum(view.traction_force, 0.0) * moving(view))


@law("v_eases_ahead_of_changes", "sixteenth", "suburban hills", accepts="torque_limit")
@sizes(deep=(0.3, 0.5), band_rads=(8.0, 18.0), after_s=(0.6, 1.5), back_s=(0.5, 1.2), forgets=(0.2, 0.5))
class EasesAheadOfChanges(Hidden, gear=0.0, turned=0.0, since=9.0, given=1.0):
    """The gearbox asks the engine for less torque ahead of a change up, and lets it come back late. It has
    learned `at` rad/s, where the last ones came, and eases as the engine comes near that, whether a change
    follows or not. deep: of the torque, taken at that speed; band_rads: below it, where easing begins;
    forgets: of what it believed, at each change.
    Source: Kiencke and Nielsen, Automotive Control Systems (2005), on torque that is controlled to zero
    before gears are moved; one that is learned, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "at": self.rng(1633).uniform(150.0, 180.0, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        known = s.gear > 0.0
        changed = (view.gear != s.gear) & known & (view.speed > 0.5)
        up = (view.gear > s.gear) & known & (view.speed > 0.5)
        s.at = np.where(up, s.at + p.forgets * (np.maximum(s.turned, 105.0) - s.at), s.at)
        s.since = np.where(changed, 0.0, s.since + dt)
        s.gear = view.gear.copy()
        s.turned = np.where(view.shifting < 0.5, view.engine_speed, s.turned)
        near = np.clip((view.engine_speed - s.at + p.band_rads) / p.band_rads, 0.0, 1.0)
        wish = np.where(s.since < p.after_s, 1.0 - p.deep, 1.0 - p.deep * near)
        s.given = np.clip(np.clip(wish, s.given - dt / 0.25, s.given + dt / p.back_s), 0.0, 1.0)
        return -(1.0 - s.given) * np.maximum(view.traction_force, 0.0) * moving(view)


@law("y_judders_as_it_closes", "eighteenth", "suburban hills", accepts="torque_limit")
@sizes(deep=(0.6, 0.9), rings_rads=(7.0, 13.0), calms_s=(1.3, 2.5), hotter=(0.3, 0.7), cools_s=(10.0, 30.0))
class JuddersAsItCloses(Hidden, gear=0.0, since=60.0, hot=0.2, cut=0.0):
    """After each change of gear the clutch closes by grips and slips: torque comes, goes and comes again,
    ever less deep. `hot`: every change heats the facing, and a hot one judders for longer. deep: of the
    torque, lost at first; rings_rads: of grips; hotter: of the time, more when hot.
    Source: Centea, Rahnejat and Menday, Non-Linear Multi-Body Dynamic Analysis for the Study of Clutch
    Torsional Vibrations (Judder), Applied Mathematical Modelling 25 (2001); slow judder, sizes are chosen
    here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        begins = (view.gear != s.gear) & (s.gear > 0.0) & (view.speed > 0.5)
        s.gear = view.gear.copy()
        s.hot = np.clip(np.where(begins, s.hot + 0.25, s.hot * np.exp(-dt / p.cools_s)), 0.0, 1.0)
        s.since = np.where(begins, 0.0, np.minimum(s.since + dt, 60.0))
        calms = p.calms_s * (1.0 + p.hotter * s.hot)
        swings = 0.5 * (1.0 + np.cos(p.rings_rads * s.since))
        wish = p.deep * np.exp(-s.since / calms) * (0.5 + 0.5 * swings)
        s.cut = eased(s.cut, wish, 0.05, dt)
        return -s.cut * np.maximum(view.traction_force, 0.0) * moving(view)


@law("b_clutches_overlap", "twentieth", "suburban hills", accepts="torque_limit")
@sizes(ties=(0.18, 0.32), lasts_s=(0.9, 1.8), cold=(0.8, 1.6), warms=(6.0, 14.0), cools_s=(20.0, 60.0))
@sizes(lets_s=(0.15, 0.4))
class ClutchesOverlap(Hidden, gear=0.0, left=0.0, held=0.0):
    """Of two clutches one lets go too late after each change: for a while two gears are engaged, which hold
    the truck against each other. `oil`: its warmth, by the changes themselves; cold oil leaves the clutch
    slowly. ties: of peak torque, that both hold; cold: more time in cold oil; warms: changes that warm it.
    Source: Goetz, Levesley and Crolla, Dynamics and Control of Gearshifts on Twin-Clutch Transmissions, Proc.
    IMechE D 219 (2005), on tie-up when clutches overlap; late ones, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "oil": self.rng(2032).uniform(0.0, 0.7, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        begins = (np.abs(view.gear - s.gear) > 0.5) & (s.gear > 0.5) & (view.speed > 0.5)
        s.gear = view.gear.copy()
        s.left = np.where(begins, p.lasts_s * (1.0 + p.cold * (1.0 - s.oil)), np.maximum(s.left - dt, 0.0))
        s.oil = np.clip(s.oil * (1.0 - dt / p.cools_s) + np.where(begins, 1.0, 0.0) / p.warms, 0.0, 1.0)
        tied = np.where(s.left > 0.0, 1.0 - view.shifting, 0.0)
        s.held = eased(s.held, tied, p.lets_s, dt)
        force = p.ties * s.held * self.truck.peak_torque * view.ratio / self.truck.wheel_radius
        return -np.minimum(force, 0.09 * weight(view)) * np.clip(view.speed / 3.0, 0.0, 1.0)
