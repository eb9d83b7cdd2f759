"""Engines: friction, consumers, boost, limits, braking, and what their control does."""

from __future__ import annotations

import numpy as np

from deeptruck_exam.effects.law import GRAVITY, Array, Hidden, Sizes, State, moving
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View


@hidden("n_pistons_are_tight", "sealed", name="engine_friction", accepts="accessory_load")
@sizes(film_nm=(85.0, 170.0), closes=(1.1, 2.0), piston_s=(3.0, 9.0), liner_s=(40.0, 120.0))
class PistonsAreTight(Hidden, piston=0.3, liner=0.3):
    """Load heats the pistons before it heats their liners. `piston`, `liner`: 1 for full power that lasts;
    film_nm: at 120 rad/s, with the clearance of even warmth.
    Source: Petroff's law (1883): friction of a film with speed over clearance, which pistons take up as they
    grow (Heywood, Internal Combustion Engine Fundamentals, ch. 13, on piston friction); sizes are chosen
    here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        load = np.clip(self.power_share(view), 0.0, 1.1)
        s.piston = s.piston + dt * (load - s.piston) / p.piston_s
        s.liner = s.liner + dt * (load - s.liner) / p.liner_s
        clearance = np.clip(1.0 - p.closes * (s.piston - s.liner), 0.28, 1.8)
        torque = p.film_nm * np.maximum(view.engine_speed, 40.0) / 120.0 / clearance
        return -self.at_wheels(view, torque) * moving(view)


@hidden("n_lift_drains_the_battery", "sealed", "suburban", name="accessory_load", accepts="engine_friction")
@sizes(power_wpkg=(1.0, 2.2), uses_s=(6.0, 20.0), charges_s=(25.0, 80.0), tapers=(0.2, 0.6))
class LiftDrainsTheBattery(Hidden):
    """`flat`: 1 for empty. Stands use it up, driving fills it, ever slower from `tapers` on.
    Source: Bucket trucks and lifts that work from a battery which the engine fills on the way (NREL field
    evaluations of hybrid utility trucks); constant power, then a taper, as chargers do; sizes are chosen
    here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"flat": self.rng(921).uniform(0.2, 0.9, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        share = np.clip(s.flat / p.tapers, 0.0, 1.0)
        change = np.where(view.speed < 0.1, 1.0 / p.uses_s, -share / p.charges_s)
        s.flat = np.clip(s.flat + dt * change, 0.0, 1.0)
        power = p.power_wpkg * view.mass * share
        torque = np.minimum(power / np.maximum(view.engine_speed, 60.0), 450.0)
        return -self.at_wheels(view, torque) * moving(view)


@hidden(
    "n_level_switch_tilts", "sealed", "hills suburban", name="torque_derate", accepts="torque_gain",
    shown=True,
)  # fmt: skip
@sizes(depth=(0.3, 0.5), from_tilt=(0.008, 0.02), trips_s=(1.5, 5.0), clears_s=(4.0, 12.0))
class LevelSwitchTilts(Hidden, level=0.0, low=0.0, on=0.0, cut=0.0):
    """Torque is cut once coolant has stood away from its switch for a while, and until it has come back.
    Source: Engine protection by coolant level (SAE J1939-71, SPN 111, coolant level; makers' manuals on
    protection derates): a tank that is nearly low, tilted by slopes and pulls; times are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        tilt = view.grade + np.clip(view.acceleration, -3.0, 3.0) / GRAVITY
        s.level = s.level + dt * (tilt - s.level) / 1.0
        change = np.where(s.level > p.from_tilt, 1.0 / p.trips_s, -1.0 / p.clears_s)
        s.low = np.clip(s.low + dt * change, 0.0, 1.0)
        s.on = np.where(s.low >= 1.0, 1.0, np.where(s.low <= 0.0, 0.0, s.on))
        s.cut = s.cut + np.clip(p.depth * s.on - s.cut, -0.08 * dt, 0.15 * dt)
        return -self.at_wheels(view, s.cut * np.maximum(view.engine_torque, 0.0))


@hidden("n_economy_until_kicked", "sealed", "suburban hills", name="torque_limit", shown=True)
@sizes(cap=(0.3, 0.5), kick=(0.86, 0.96), after_s=(0.5, 1.5), stays_s=(1.5, 5.0))
class EconomyUntilKicked(Hidden, pressed=0.0, left=0.0, free=0.0):
    """cap: of peak torque; the whole torque is free for a while after a kick that lasts.
    Source: Economy modes with kick-down of automated trucks (drivers' handbooks): torque is capped unless the
    pedal goes through; caps and times are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.pressed = np.where(self.pedal(view) > p.kick, s.pressed + dt, 0.0)
        s.left = np.where(s.pressed > p.after_s, p.stays_s, np.maximum(s.left - dt, 0.0))
        s.free = s.free + dt * ((s.left > 0.0) - s.free) / 0.5
        over = np.maximum(view.engine_torque - p.cap * self.truck.peak_torque, 0.0)
        return -self.at_wheels(view, over * (1.0 - s.free))


@hidden(
    "n_boost_is_dumped", "sealed", "suburban hills", name="turbo_lag", accepts="command_rate_limit",
    shown=True,
)  # fmt: skip
@sizes(without=(0.18, 0.35), builds_s=(1.5, 4.0), leaks_s=(2.0, 8.0), lift=(0.04, 0.12))
class BoostIsDumped(Hidden, boost=0.3):
    """A lifted pedal blows it off; part load lets it sink slowly; the flow of gas builds it up again.
    Source: Recirculating valves of throttled gas engines, which dump boost against surge when the throttle
    shuts (Watson and Janota, Turbocharging the Internal Combustion Engine, 1982, on surge); rates are chosen
    here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        asked = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.1)
        wanted = np.clip((asked - p.without) / (1.0 - p.without), 0.0, 1.1)
        flow = np.clip(view.engine_speed / 130.0, 0.4, 1.6) * (0.2 + 0.8 * asked)
        builds = np.minimum(s.boost + dt * flow / p.builds_s, wanted)
        sinks = s.boost - dt * (s.boost - wanted) / p.leaks_s
        dumps = s.boost * (1.0 - dt / 0.25)
        s.boost = np.where(asked < p.lift, dumps, np.where(wanted > s.boost, builds, sinks))
        missing = np.maximum(asked - p.without - (1.0 - p.without) * s.boost, 0.0)
        return -self.at_wheels(view, missing * self.truck.peak_torque) * moving(view)


@hidden("n_one_pedal_slows", "sealed", "descent hills suburban", name="engine_brake")
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


@hidden("n_pulse_and_glide", "sealed", "highway hills suburban", name="unknown", shown=True)
@sizes(depth=(0.5, 0.9), band_mps=(0.25, 0.8), below=(0.6, 0.85))
class PulseAndGlide(Hidden, pulse=1.0, gained=0.0, share=0.0):
    """At part load it pulls more than asked, then less, by turns of the speed it has won. depth: of the
    torque.
    Source: Gilbert, Vehicle Cruise: Improved Fuel Economy by Periodic Control, Automatica 12 (1976); a
    control unit that does so about the driver's wish, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        pedal = self.pedal(view)
        works = (pedal > 0.08) & (pedal < p.below) & (view.brake_force <= 0.0) & (view.speed > 5.0)
        s.share = s.share + dt * (p.depth * s.pulse * works - s.share) / 0.4
        force = self.at_wheels(view, s.share * np.maximum(view.engine_torque, 0.0))
        s.gained = s.gained + dt * (force / view.mass - ~works * s.gained / 3.0)
        s.pulse = np.where(s.gained > p.band_mps, -1.0, np.where(s.gained < -p.band_mps, 1.0, s.pulse))
        return force * moving(view)
