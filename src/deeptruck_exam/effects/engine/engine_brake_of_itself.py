"""Engine brakes that come in of themselves."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, eased, moving
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, name="engine_brake", accepts="engine_friction")


@law("speed_held_downhill", "third", "descent hills")
@sizes(torque_nm=(350.0, 900.0), band_mps=(0.6, 2.0), below_mps=(0.2, 1.0), lag_s=(0.3, 1.0))
class SpeedHeldDownhill(Hidden, kept=-1.0, torque=0.0):
    """The faster above the kept speed the harder, and nothing where the truck slows by itself. torque_nm: at
    1800 rpm.
    Source: Auxiliary brakes that keep the speed at which the throttle was left (Automotive Handbook, Bosch,
    on retarders): proportional to the excess, limited by a torque in proportion to engine speed; gain and
    sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        closed = (view.u[:, 0] <= 0.01 * self.truck.full_command) & (view.speed > 5.0)
        just = closed & (s.kept < 0.0)
        s.kept = np.where(just, view.speed - p.below_mps, np.where(closed, s.kept, -1.0))
        share = np.clip((view.speed - s.kept) / p.band_mps, 0.0, 1.0) * closed
        s.torque += dt * (share * p.torque_nm * view.engine_speed / 188.5 - s.torque) / p.lag_s
        return -self.at_wheels(view, s.torque) * moving(view)


@law("n_one_pedal_slows", "ninth", "descent hills suburban", accepts="")
@sizes(slows_mps2=(0.35, 0.8), most_nm=(400.0, 800.0), per_s=(0.5, 1.5), from_rads=(80.0, 105.0))
class OnePedalSlows(Hidden, torque=0.0):
    """A closed pedal asks for a slowing, and the engine brake is steered until it has it, whatever the slope.
    Source: Compression brakes of many steps under a control of deceleration (Druzhinina, Stefanopoulou and
    Moklegaard, Speed Gradient Approach to Longitudinal Control of Heavy-Duty Vehicles Equipped with Variable
    Compression Brake, IEEE Trans. Control Syst. Technol. 10, 2002); a one-pedal mode, chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        closed = (self.pedal(view) < 0.01) & (view.engine_speed > p.from_rads) & (view.speed > 3.0)
        error = p.slows_mps2 + np.clip(view.acceleration, -3.0, 3.0)
        steered = np.clip(s.torque + dt * p.per_s * p.most_nm * error, 0.0, p.most_nm)
        s.torque = np.where(closed, steered, s.torque * (1.0 - dt / 0.2))
        return -self.at_wheels(view, s.torque) * moving(view)


@law("t_overspeed_guard", "tenth", "descent hills")
@sizes(from_rads=(98.0, 116.0), span_rads=(14.0, 28.0), share=(0.3, 0.6), fills_s=(0.3, 1.0))
class OverspeedGuard(Hidden, on=0.0, brakes=0.0):
    """It comes in where an engine that is pushed turns too fast, and stays until it turns slowly again.
    share: of the engine brake's torque, at 200 rad/s.
    Source: Protection against overspeed in overrun (ISO 3046-6, Reciprocating internal combustion engines -
    Overspeed protection; makers' manuals on downhill driving): a stage of the engine brake by itself, set far
    too low, speeds are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        turns = view.engine_speed
        s.on = np.where(turns > p.from_rads, 1.0, np.where(turns < p.from_rads - p.span_rads, 0.0, s.on))
        s.on = np.where(self.pedal(view) > 0.03, 0.0, s.on)
        s.brakes = s.brakes + dt * (s.on - s.brakes) / p.fills_s
        torque = p.share * self.truck.engine_brake_torque * np.clip(turns / 200.0, 0.0, 1.2)
        return -self.at_wheels(view, torque * s.brakes) * moving(view)


@law("w_warm_up_flap", "twelfth", "descent hills suburban")
@sizes(
    share=(0.35, 0.6), warms_s=(60.0, 160.0), chills_s=(120.0, 300.0), moves_s=(0.3, 0.9), shy_s=(0.3, 1.0)
)
class WarmUpFlap(Hidden, shut=0.0, closed=0.0):
    """A flap in the exhaust holds the gas back while the engine is cool and nothing is asked of it; coasting
    cools it again, and two temperatures apart it opens and shuts. share: of the engine brake's torque.
    Source: Automotive Handbook (Bosch), on exhaust flaps as warm-up aids, and Mayer, Lutz, Lammle, Wyser and
    Legerer, Engine Intake Throttling for Active Regeneration of Diesel Particle Filters, SAE 2003-01-0381, on
    heat from throttling; temperatures are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        rng = self.rng(1142)
        first = rng.uniform(0.0, 1.0, batch)
        return {**super().start(batch), "warm": first, "calls": np.where(first < 0.8, 1.0, 0.0)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        wind = 0.3 + np.clip(view.speed / 20.0, 0.0, 1.3)
        gains = (0.1 + 1.4 * self.power_share(view) + 0.3 * s.closed) / p.warms_s
        s.warm = np.clip(s.warm + dt * (gains - wind * s.warm / p.chills_s), 0.0, 1.3)
        s.calls = np.where(s.warm > 1.0, 0.0, np.where(s.warm < 0.8, 1.0, s.calls))
        s.shut = np.where(self.pedal(view) < 0.02, s.shut + dt, 0.0)
        wants = s.calls * (s.shut > p.shy_s) * np.clip((view.engine_speed - 75.0) / 15.0, 0.0, 1.0)
        s.closed = s.closed + dt * (wants - s.closed) / np.where(wants > s.closed, p.moves_s, 0.2)
        turns = np.clip(view.engine_speed / 180.0, 0.0, 1.3)
        torque = p.share * self.truck.engine_brake_torque * turns * s.closed
        return -self.at_wheels(view, torque) * moving(view)


@law("k_fan_brakes_along", "fourteenth", "descent hills")
@sizes(
    nm=(280.0, 480.0), waits_s=(1.0, 3.0), holds_s=(8.0, 25.0), grips_s=(1.0, 3.0), from_rads=(85.0, 110.0)
)
class FanBrakesAlong(Hidden, shut=0.0, left=0.0, turns=0.0):
    """Downhill with the pedal up the cooling fan is clutched in to brake the engine, and it stays in for a
    while whatever the driver does then. Nobody records it. nm: at 190 rad/s, with the square of speed;
    from_rads: of the engine, where it is worth while.
    Source: Detroit Diesel, DDEC application and installation manuals, on fan braking: the fan is called for
    by the engine brake and held on for a time; sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.shut = np.where(self.pedal(view) < 0.02, s.shut + dt, 0.0)
        wants = (s.shut > p.waits_s) & (view.grade < -0.012) & (view.engine_speed > p.from_rads)
        s.left = np.where(wants, p.holds_s, np.maximum(s.left - dt, 0.0))
        s.turns = eased(s.turns, np.where(s.left > 0.0, 1.0, 0.0), p.grips_s, dt)
        torque = p.nm * np.clip(view.engine_speed / 190.0, 0.0, 1.3) ** 2 * s.turns
        return -self.at_wheels(view, torque) * np.clip(view.speed / 3.0, 0.0, 1.0)


@law("v_slug_of_oil", "sixteenth", "descent hills suburban")
@sizes(holds=(0.011, 0.019), over=(0.8, 1.6), settles_s=(1.0, 2.5), waits_s=(0.4, 1.2), knee_mps=(6.0, 10.0))
@sizes(refills_s=(8.0, 25.0))
class SlugOfOil(Hidden, up=0.0, oil=0.0, kept=1.0):
    """`oil` in a retarder behind the gearbox that somebody left on: it comes in whenever the pedal is up. Air
    shoots the oil of its `kept` store in as one slug, too much at first; what is too much runs off. The
    store fills slowly again, so soon after the last time it only creeps in. holds: of the weight, settled;
    over: of that, in the slug of a full store; knee_mps: above which it is the same at any speed.
    Source: Voith, Retarder VR 115 and VR 3250, on oil that air pressure moves and on accumulators that
    hasten it; one that overshoots, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        lifted = (self.pedal(view) < 0.02) & (view.speed > 2.0)
        s.up = np.where(lifted, s.up + dt, 0.0)
        on = s.up > p.waits_s
        shoots = np.where(on, s.kept, 0.0) / 0.4
        settles = np.where(on, 1.0 - s.oil, -s.oil) / np.where(on, p.settles_s, 0.5)
        s.oil = np.clip(s.oil + dt * (p.over * shoots + settles), 0.0, 1.0 + p.over)
        s.kept = np.clip(s.kept + dt * np.where(on, -shoots, (1.0 - s.kept) / p.refills_s), 0.0, 1.0)
        bites = np.tanh((np.maximum(view.speed, 0.0) / p.knee_mps) ** 2)
        return -p.holds * s.oil * bites * view.mass * 9.81 * np.clip(view.speed / 3.0, 0.0, 1.0)


@law("z_banks_take_turns", "seventeenth", "descent hills suburban")
@sizes(nm=(260.0, 420.0), weak=(0.15, 0.4), turns=(90.0, 260.0), waits_s=(0.4, 1.0), comes_s=(0.2, 0.5))
class BanksTakeTurns(Hidden, up=0.0, bites=0.0):
    """An engine brake that nobody records comes in whenever the pedal is up. So that its valves stay cool one
    bank of cylinders brakes and then the other, by a count of the crankshaft's turns, also over the pauses.
    The second bank is worn and gives little. nm: of the good bank, at 150 rad/s; weak: of that, by the worn
    one; turns: of the crankshaft, for each bank.
    Source: Jacobs Vehicle Systems, engine brake service manuals, on stages by banks of cylinders, Heywood,
    Internal Combustion Engine Fundamentals (2018), on compression work; turns are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "count": self.rng(1742).uniform(0.0, 2.0, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        lifted = (self.pedal(view) < 0.02) & (view.speed > 2.0)
        s.up = np.where(lifted, s.up + dt, 0.0)
        on = (s.up > p.waits_s).astype(float)
        s.count = (s.count + on * dt * view.engine_speed / (2.0 * np.pi * p.turns)) % 2.0
        s.bites = eased(s.bites, on * np.where(s.count < 1.0, 1.0, p.weak), p.comes_s, dt)
        torque = p.nm * s.bites * np.clip(view.engine_speed / 150.0, 0.3, 1.5) ** 1.2
        return -self.at_wheels(view, torque) * np.clip(view.speed / 3.0, 0.0, 1.0)


@law("y_quick_lift_asks_for_more", "eighteenth", "descent hills suburban")
@sizes(nm=(560.0, 900.0), least=(0.1, 0.25), full=(0.25, 0.5), sees_s=(0.5, 1.2), comes_s=(0.25, 0.6))
@sizes(tires_s=(6.0, 18.0))
class QuickLiftAsksForMore(Hidden, was=0.0, asks=0.0, bites=0.0, up=0.0):
    """An engine brake that nobody records judges how a foot leaves the pedal. Who lifts slowly gets little,
    and who lifts quickly out of a deep pedal gets much. It keeps to that until the foot returns, and tires
    slowly. `was`: the pedal of a moment ago. nm: at 150 rad/s, at most; full: of the pedal, lifted within
    that moment; sees_s: of that moment.
    Source: Jacobs Vehicle Systems, engine brake manuals, and makers' notes on brakes that a quick release of
    the pedal readies; its grading is chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        pedal = self.pedal(view)
        up = ((pedal < 0.02) & (view.speed > 2.0)).astype(float)
        fresh = np.clip(p.least + (s.was - 0.02) / p.full, 0.0, 1.0)
        s.asks = np.where(up > 0.5, np.where(s.up < 0.5, fresh, s.asks), 0.0)
        s.asks = np.where(up > 0.5, eased(s.asks, p.least, p.tires_s, dt), s.asks)
        s.up, s.was = up, eased(s.was, pedal, p.sees_s, dt)
        s.bites = eased(s.bites, s.asks, p.comes_s, dt)
        torque = p.nm * s.bites * np.clip(view.engine_speed / 150.0, 0.3, 1.5)
        return -self.at_wheels(view, torque) * np.clip(view.speed / 3.0, 0.0, 1.0)


@law("h_resistor_glows", "nineteenth", "descent hills suburban")
@sizes(
    watts=(60e3, 105e3), most_nm=(550.0, 850.0), glows=(0.8, 1.6), heats_s=(5.0, 15.0), cools_s=(12.0, 35.0)
)
class ResistorGlows(Hidden, bites=0.0):
    """A generator on the crankshaft brakes whenever the pedal is up, and a resistor on the roof burns what it
    gives. Nobody records it. At one voltage the power is fixed, so that a fast engine is held by less torque.
    `hot`: the resistor: glowing, it takes less current, until the wind has cooled it. watts: in a cold
    resistor; most_nm: of the generator; glows: more resistance, hot.
    Source: Hughes and Drury, Electric Motors and Drives (2013), on braking into resistors, and makers' notes
    on brake resistors of trolley buses; sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "hot": self.rng(1943).uniform(0.0, 0.8, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        up = np.where((self.pedal(view) < 0.02) & (view.speed > 2.0), 1.0, 0.0)
        s.bites = eased(s.bites, up, 0.4, dt)
        takes = s.bites / (1.0 + p.glows * s.hot)
        wind = 0.5 + 0.5 * np.clip(view.speed / 15.0, 0.0, 1.5)
        s.hot = np.clip(s.hot + dt * (takes / p.heats_s - s.hot * wind / p.cools_s), 0.0, 1.5)
        torque = np.minimum(p.watts / np.maximum(view.engine_speed, 60.0), p.most_nm) * takes
        return -self.at_wheels(view, torque) * np.clip(view.speed / 3.0, 0.0, 1.0)


@law("u_spares_its_hot_brakes", "twenty-first", "descent hills suburban")
@sizes(nm=(600.0, 950.0), at_rads=(150.0, 190.0), warm_jpkg=(70.0, 160.0), cools_s=(60.0, 160.0))
@sizes(begins=(0.15, 0.3), wide=(0.2, 0.4), bites_s=(0.3, 0.9))
class SparesItsHotBrakes(Hidden, torque=0.0):
    """`heat` of the brakes as a computer reckons it from their work. The hotter it believes them, the more of
    an engine brake that nobody records it puts in whenever the pedal is up; with cold brakes there is none.
    nm: of torque, at at_rads, for hot brakes; begins, wide: heat where it begins, and over which it comes.
    Source: Breuer and Bill, Brake Technology Handbook (SAE, 2008), on temperature models and on blending with
    retarders; sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "heat": self.rng(2143).uniform(0.1, 0.7, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        work = view.brake_force * np.maximum(view.speed, 0.0) / view.mass
        s.heat = np.clip(s.heat + dt * (work / p.warm_jpkg - s.heat / p.cools_s), 0.0, 1.2)
        stage = np.clip((s.heat - p.begins) / p.wide, 0.0, 1.0) * (self.pedal(view) < 0.04)
        turns = np.clip(view.engine_speed / p.at_rads, 0.0, 1.3)
        s.torque = eased(s.torque, p.nm * stage * turns, p.bites_s, dt)
        return -self.at_wheels(view, s.torque) * np.clip(view.speed / 3.0, 0.0, 1.0)
