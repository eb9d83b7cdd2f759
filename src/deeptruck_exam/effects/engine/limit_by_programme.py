"""Limits of the torque that a programme sets: by gear, place, bend, conduct or slope."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, eased, moving, weight
from deeptruck_exam.effects.places import Bends, OnRoad, smooth_stretches
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, name="torque_limit", shown=True)


@law("progressive_shift", "fourth", "suburban hills")
@sizes(at_rest_rpm=(1020.0, 1180.0), rises_rpm=(120.0, 280.0), band_rpm=(120.0, 280.0), most=(0.3, 0.5))
class ProgressiveShift(Hidden):
    """rises_rpm: to 20 m/s.
    Source: Progressive shift of fleets' electronic features (owner's manuals of heavy diesels): the engine
    speed up to which torque is given rises with road speed, and fades out over a band; limits are chosen
    here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        rpm = view.engine_speed * 30.0 / np.pi
        limit = p.at_rest_rpm + p.rises_rpm * np.clip(view.speed / 20.0, 0.0, 1.3)
        cut = p.most * np.clip((rpm - limit) / p.band_rpm, 0.0, 1.0)
        return -self.at_wheels(view, cut * np.maximum(view.engine_torque, 0.0))


@law("full_torque_in_top_gears", "fourth", "suburban hills")
@sizes(cut=(0.45, 0.64), from_ratio=(0.95, 1.35), blend_s=(0.3, 1.2))
class FullTorqueInTopGears(Hidden):
    """from_ratio: of the gearbox; numerically higher ones are lower gears.
    Source: Multi-torque ratings (engine makers' data sheets): the higher torque is given in the top gears
    alone, to save weight in gearbox and axle; ratings and the blend at a change are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"rating": np.full(batch, 1.0 - self.p.cut)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        low = view.ratio > p.from_ratio * self.truck.final_drive
        s.rating += dt * (np.where(low, 1.0 - p.cut, 1.2) - s.rating) / p.blend_s
        over = view.engine_torque - s.rating * self.truck.peak_torque
        return -self.at_wheels(view, np.maximum(over, 0.0))


@law("acceleration_management", "fifth", "suburban hills")
@sizes(at_rest=(0.30, 0.55), per_mps=(0.010, 0.022), winds=(0.6, 1.8), lets_out_s=(3.0, 9.0))
class AccelerationManagement(Hidden, cut=0.0, gains=0.0):
    """Downhill it takes torque that was needed for nothing, uphill none at all. at_rest: m/s2; winds: of peak
    torque, each second and m/s2.
    Source: Vehicle acceleration management of heavy engines (owner's manuals on electronic features): the
    control unit winds torque back while the truck gains speed faster than a limit that falls with speed, and
    lets it out again slowly; an empty truck feels it, a full one does not; sizes chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.gains += dt * (np.clip(view.acceleration, -3.0, 3.0) - s.gains) / 0.25
        limit = np.maximum(p.at_rest - p.per_mps * np.maximum(view.speed, 0.0), 0.08)
        over = s.gains - limit
        change = np.where(over > 0.0, p.winds * over, -s.cut / p.lets_out_s)
        share = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.1)
        s.cut = np.clip(s.cut + dt * change, 0.0, 0.6) * (share > 0.02)
        return -self.at_wheels(view, np.minimum(s.cut, share) * self.truck.peak_torque)


@law("n_economy_until_kicked", "ninth", "suburban hills")
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


@law("w_torque_by_the_bend", "twelfth", "suburban hills")
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


@law("x_torque_by_good_conduct", "thirteenth", "suburban hills")
@sizes(least=(0.28, 0.45), counts=(0.25, 0.5), forgets_s=(60.0, 200.0), harsh=(0.5, 0.8), gives_s=(1.0, 3.0))
class TorqueByGoodConduct(Hidden, foot=0.0, pulled=0.0, most=1.1):
    """`score`: harsh acts of late. Each kick of the pedal and each hard braking counts, calm minutes take it
    back; who has a bad score gets less of the torque. least: of peak torque, at the worst; counts: of the
    worst, for each act; harsh: of the full pedal, within half a second or so.
    Source: Toledo, Musicant and Lotan, In-Vehicle Data Recorders for Monitoring and Feedback on Drivers'
    Behavior, Transportation Research C 16 (2008): manoeuvres that are counted and weighed; here the truck
    answers them, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "score": self.rng(1332).uniform(0.2, 0.9, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        pedal = self.pedal(view)
        s.foot = s.foot + dt * (pedal - s.foot) / 0.8
        kick = np.clip((pedal - s.foot) / (0.5 * p.harsh), 0.0, 1.5)
        hard = np.clip(view.brake_force / weight(view) / 0.12, 0.0, 1.5)
        acts = np.maximum(np.maximum(kick, hard) - 0.5, 0.0)
        s.score = np.clip(s.score + dt * (p.counts * acts - s.score / p.forgets_s), 0.0, 1.0)
        allows = 1.1 - (1.1 - p.least) * np.clip(1.3 * s.score - 0.15, 0.0, 1.0)
        s.most = s.most + dt * (allows - s.most) / p.gives_s
        excess = np.maximum(view.engine_torque - s.most * self.truck.peak_torque, 0.0)
        return -self.at_wheels(view, excess) * moving(view)


@law("k_quiet_at_night", "fourteenth", "suburban hills")
@sizes(least=(0.2, 0.34), hushed_rads=(95.0, 112.0), power=(1.0, 2.0), apart_m=(120.0, 420.0))
@sizes(eases_s=(0.8, 2.0))
class QuietAtNight(OnRoad, quiet=0.0):
    """In places where people sleep, which a map holds, torque is limited so that the engine stays quiet, the
    more so the faster it turns. least: of peak torque; hushed_rads: where that is allowed.
    Source: Heywood, Internal Combustion Engine Fundamentals (2018), on combustion noise over load and speed,
    and the Dutch PIEK scheme for quiet night deliveries; places and sizes are chosen here."""

    def prepare(self) -> None:
        gaps = (0.4 * self.p.apart_m, 1.6 * self.p.apart_m)
        zones = smooth_stretches(self.rng(1443), self.rows(), gaps, (300.0, 1100.0))
        self.road = np.clip((zones - 0.1) / 0.15, 0.0, 1.0)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.quiet = eased(s.quiet, self.read(self.road, view), p.eases_s, dt)
        turns = np.maximum(view.engine_speed, 60.0) / p.hushed_rads
        cap = np.minimum(p.least * turns**-p.power, 1.1)
        most = 1.1 + (cap - 1.1) * s.quiet
        excess = np.maximum(view.engine_torque - most * self.truck.peak_torque, 0.0)
        return -self.at_wheels(view, excess) * moving(view)


@law("v_full_torque_uphill_only", "sixteenth", "suburban highway hills", accepts="turbo_lag")
@sizes(flat=(0.34, 0.48), at=(0.012, 0.024), wide=(0.004, 0.009), feels_s=(1.5, 4.0), weighs=(0.1, 0.25))
class FullTorqueUphillOnly(Hidden, slope=-9.0):
    """A programme that saves fuel: on the flat the engine may give part of its torque, and all of it only on
    a slope, which it feels some seconds late. It takes the truck's own pull for part of a slope. flat: of
    peak torque; at, wide: slope where half of the rest is free, and how softly; weighs: of the acceleration
    over g, taken for slope.
    Source: Volvo Trucks, I-Torque and I-See, and Scania, Eco mode, on torque that is set free by slope and
    load; a stern one, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        seems = view.grade + p.weighs * np.clip(view.acceleration, -2.0, 2.0) / 9.81
        s.slope = np.where(s.slope < -5.0, seems, eased(s.slope, seems, p.feels_s, dt))
        free = 1.0 / (1.0 + np.exp(-np.clip((s.slope - p.at) / p.wide, -30.0, 30.0)))
        most = (p.flat + (1.2 - p.flat) * free) * self.truck.peak_torque
        excess = np.maximum(view.engine_torque - most, 0.0)
        return -self.at_wheels(view, excess) * moving(view)


@law("y_gear_is_run_in", "eighteenth", "suburban hills", accepts="turbo_lag torque_derate shift_interruption")
@sizes(least=(0.22, 0.36), way_m=(55.0, 140.0), power=(1.0, 2.0), low=(0.3, 0.7))
class GearIsRunIn(Hidden, gear=0.0, way=200.0):
    """After each change the gearbox lets the engine pull only as much as the oil on the new teeth allows.
    That grows with the way in this gear, and low gears need more of it. `way` m in this gear. least: of peak
    torque, at first; way_m: until all is free; low: of that way, more in the lowest gears.
    Source: Naunheimer, Bertsche, Ryborz and Novak, Automotive Transmissions (2011), on protection of gears by
    torque intervention; a careful programme, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        changed = (view.gear != s.gear) & (s.gear > 0.0)
        s.gear = view.gear.copy()
        s.way = np.where(changed, 0.0, np.minimum(s.way + dt * np.maximum(view.speed, 0.0), 1e3))
        needs = p.way_m * (1.0 + p.low * np.clip(1.0 - view.gear / 10.0, 0.0, 1.0))
        free = np.minimum(s.way / needs, 1.0) ** p.power
        most = (p.least + (1.1 - p.least) * free) * self.truck.peak_torque
        return -self.at_wheels(view, np.maximum(view.engine_torque - most, 0.0)) * moving(view)


@law("u_litres_for_each_kilometre", "twenty-first", "hills suburban", accepts="torque_derate")
@sizes(share=(0.14, 0.26), holds_m=(120.0, 350.0), least=(0.3, 0.45), knee=(0.2, 0.4))
class LitresForEachKilometre(Hidden):
    """A fleet allows so much fuel for each kilometre. `account`: what is saved up, 1 the most; way fills it,
    the engine's work empties it, and a nearly empty one limits the torque. So slow climbs run into the limit
    and fast ones hardly do. share: work for each metre, over that of peak power at 20 m/s; holds_m: at peak
    power and 20 m/s, until a full one is empty; least: of peak torque, from an empty one; knee: of the
    account, below which it limits.
    Source: makers' notes on programmes that hold a fleet's consumption; such a programme by the way and its
    sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"account": self.rng(2142).uniform(0.2, 0.9, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        allowed = p.least + (1.0 - p.least) * np.clip(s.account / p.knee, 0.0, 1.0)
        most = allowed * self.truck.peak_torque
        burns = 20.0 * np.minimum(self.power_share(view), allowed + 0.1)
        earns = p.share * np.maximum(view.speed, 0.0)
        s.account = np.clip(s.account + dt * (earns - burns) / p.holds_m, 0.0, 1.0)
        return -self.at_wheels(view, np.maximum(view.engine_torque - most, 0.0)) * moving(view)
