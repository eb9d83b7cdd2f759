"""Worn claws, a split of power, a calm foot, a pump that draws air, a rotor that comes and
goes, a limit in bends, and a flywheel that pays."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import GRAVITY, Array, Hidden, Sizes, State, moving, weight
from deeptruck_exam.effects.places import Bends
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")
BY_HAND = "trucksim volvo"  # gearboxes without a converter


@law("w_claws_are_worn", needs="suburban hills", name="driveline_backlash")
@sizes(play=(0.35, 0.6), soft=(0.03, 0.07), crosses_s=(0.18, 0.4), hardens=(1.5, 4.0))
class ClawsAreWorn(Hidden, twist=0.0):
    """`twist` of a coupling with rubber between its claws, 1 at the end of soft rubber. Where the rubber is
    gone there is play, through which it is pushed against its grease by whatever pull there is. play: of the
    twist, either side; soft: pull over weight at a twist of 1; hardens: of the rubber, with its square.
    Source: Nestorides, A Handbook on Torsional Vibration (1958), on couplings whose rubber stiffens, and Kim,
    Rook and Singh, Super- and Sub-harmonic Response Calculations for a Torsional System with Clearance
    Nonlinearity Using the Harmonic Balance Method, J. Sound Vibration 281 (2005); sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        pull = view.traction_force / weight(view)
        beyond = s.twist - np.clip(s.twist, -p.play, p.play)
        carries = p.soft * beyond * (1.0 + p.hardens * beyond**2)
        rate = np.clip((pull - carries) / p.soft, -4.0, 4.0) / p.crosses_s
        s.twist = np.clip(s.twist + dt * rate * 0.6, -2.5, 2.5)
        return np.asarray((carries - pull) * weight(view) * np.clip(view.speed, 0.0, 1.0))


@law("w_power_is_split", name="driveline_loss", accepts="torque_gain")
@sizes(least=(0.01, 0.03), away=(0.07, 0.14), lock_mps=(8.0, 11.0), second=(1.8, 2.2), cold=(0.3, 0.8))
@sizes(warms_s=(80.0, 240.0))
class PowerIsSplit(Hidden, warm=0.0):
    """Part of the power goes by oil: none at two speeds, where gears alone drive, and the more the farther
    away from the nearest. least, away: of the traction; second: of the first speed; cold: more, by cold oil.
    Source: Renius and Resch, Continuously Variable Tractor Transmissions, ASAE Distinguished Lecture 29
    (2005): full-load efficiency peaks at lock-up points; such a gearbox in a truck, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        work = 0.3 + np.abs(view.traction_force) * speed / self.truck.peak_power
        s.warm = s.warm + dt * (1.0 - s.warm) * work / p.warms_s
        ratio = np.log(np.maximum(speed, 1.0) / p.lock_mps)
        off = np.minimum(np.abs(ratio), np.abs(ratio - np.log(p.second)))
        by_oil = 1.0 - np.exp(-((off / 0.28) ** 2))
        lost = (p.least + p.away * by_oil) * (1.0 + p.cold * (1.0 - s.warm))
        return np.asarray(-lost * np.abs(view.traction_force) * moving(view))


@law("w_waits_for_a_calm_foot", needs="suburban hills", name="shift_interruption", trucks=BY_HAND)
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


@law(
    "w_pump_draws_air",
    needs="hills suburban",
    name="torque_converter_slip",
    accepts="driveline_loss torque_limit",
    trucks="freightliner",
    gateable=False,
)
@sizes(tilt=(0.012, 0.03), foams_s=(1.5, 5.0), settles_s=(6.0, 20.0), holds=(0.12, 0.25), drags=(0.2, 0.5))
class PumpDrawsAir(Hidden, air=0.0):
    """`air` in the oil of a low sump, drawn in while slope and pull tilt it away from the pump. The lock-up
    clutch is pressed by that oil: what is beyond its hold slips. tilt: slope at which it begins; holds: of
    peak torque, with all air; drags: of the slip's torque, that reaches the wheels yet.
    Source: Totten (ed.), Handbook of Lubrication and Tribology I (2006), on entrained air in transmission
    fluids, and service manuals of automatic truck gearboxes on low levels uphill; sizes are chosen here."""

    conceal = ("engine_speed",)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        tilted = view.grade + np.clip(view.acceleration, -2.0, 2.0) / GRAVITY
        wants = np.clip((np.abs(tilted) - p.tilt) / 0.03, 0.0, 1.0)
        s.air = s.air + dt * (wants - s.air) / np.where(wants > s.air, p.foams_s, p.settles_s)
        holds = (1.1 - (1.1 - p.holds) * s.air) * self.truck.peak_torque
        torque = view.engine_torque
        slips = np.sign(torque) * np.maximum(np.abs(torque) - holds, 0.0) * (1.0 - p.drags)
        drag = 0.3 * s.air * np.minimum(torque, 0.0)
        return -self.at_wheels(view, slips + drag) * np.clip(view.speed - 1.0, 0.0, 1.0)


@law("w_rotor_comes_and_goes", needs="suburban hills", name="rotating_inertia", accepts="mass payload_change")
@sizes(share=(0.18, 0.32), on_s=(20.0, 70.0), off_s=(15.0, 50.0), couples_s=(0.6, 1.5), feels_s=(0.15, 0.4))
class RotorComesAndGoes(Hidden, holds=0.0, speed=-1.0):
    """A clutch couples a heavy rotor to the wheels whenever its owner calls for it, by the clock; then its
    rim has to be sped up and slowed down with the truck. share: of the mass, as felt at the road.
    Source: Wong, Theory of Ground Vehicles (2008), on the mass factor of rotating parts, and the
    electromagnetic clutches of makers' power take-offs; a flail's rotor, spells are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        turn = self.rng(1136).uniform(0.0, self.p.on_s + self.p.off_s, batch)
        return {**super().start(batch), "clock": turn}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.speed = np.where(s.speed < 0.0, view.speed, s.speed)
        lag = (view.speed - s.speed) / p.feels_s
        s.speed = s.speed + dt * lag
        s.clock = (s.clock + dt) % (p.on_s + p.off_s)
        wants = (s.clock < p.on_s) * 1.0
        s.holds = s.holds + dt * (wants - s.holds) / p.couples_s
        felt = np.clip(lag, -2.5, 2.5)
        return -p.share * s.holds * view.mass * felt * np.clip(view.speed - 0.3, 0.0, 1.0)


@law("w_torque_by_the_bend", needs="suburban hills", name="torque_limit", shown=True)
@sizes(least=(0.2, 0.4), from_mps2=(0.35, 0.7), full_mps2=(1.1, 1.8), gives_s=(0.8, 2.5))
class TorqueByTheBend(Bends, most=1.1):
    """`most`: over peak torque, what may be asked for: the less, the more a bend presses a tall load aside,
    taken at once and given back slowly behind the bend.
    Source: Palkovics, Semsey and Gerum, Roll-over Prevention System for Commercial Vehicles - Additional
    Sensorless Function of the Electronic Brake System, Vehicle System Dynamics 32 (1999), here by engine
    torque alone; thresholds and bends are chosen here."""

    def prepare(self) -> None:
        self.bend = self.draw_bends(self.rng(1137), 0.022)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        aside = np.minimum(view.speed**2 * np.abs(self.read(self.bend, view)), 3.0)
        hard = np.clip((aside - p.from_mps2) / (p.full_mps2 - p.from_mps2), 0.0, 1.0)
        allows = 1.1 - (1.1 - p.least) * hard
        s.most = s.most + dt * (allows - s.most) / np.where(allows < s.most, 0.15, p.gives_s)
        excess = np.maximum(view.engine_torque - s.most * self.truck.peak_torque, 0.0)
        return -self.at_wheels(view, excess) * moving(view)


@law("w_flywheel_pays", needs="suburban hills", name="unknown", trucks=BY_HAND)
@sizes(inertia=(0.7, 1.3), lasts_s=(0.4, 1.0), bites_s=(0.1, 0.25), most=(0.05, 0.09))
class FlywheelPays(Hidden, ratio=0.0, owed=0.0, push=0.0):
    """The clutch closes before the engine has the new gear's speed: the flywheel gives what it has too much
    to the truck, and takes what it lacks. inertia: over that of the engine; most: of the weight.
    Source: Kiencke and Nielsen, Automotive Control Systems (2005), and Dolcini, Canudas de Wit and Bechart,
    Lurch Avoidance Strategy and Its Implementation in AMT Vehicles, Mechatronics 18 (2008), on engagement at
    unequal speeds; sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        wheel = np.maximum(view.speed, 0.0) / self.truck.wheel_radius
        changed = (s.ratio > 0.0) & (np.abs(view.ratio - s.ratio) > 0.02 * s.ratio) & (view.speed > 1.0)
        spin = np.clip((s.ratio - view.ratio) * wheel, -70.0, 70.0)
        impulse = p.inertia * self.truck.engine_inertia * spin * view.ratio / self.truck.wheel_radius
        s.owed = np.where(changed, impulse, s.owed)
        s.ratio = view.ratio.copy()
        pays = s.owed * (1.0 - view.shifting) / p.lasts_s
        pays = np.clip(pays, -p.most * weight(view), p.most * weight(view))
        s.owed = s.owed - dt * pays
        s.push = s.push + dt * (pays - s.push) / p.bites_s
        return np.asarray(s.push * np.clip(view.speed - 0.5, 0.0, 1.0))
