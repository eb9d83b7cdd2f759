"""Engines: friction, accessories, limits, boost and braking."""

from __future__ import annotations

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, moving
from deeptruck_exam.effects.places import Bends
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

EVERY = "highway suburban hills descent"


@hidden("s_gelled_oil", "sealed", EVERY, name="engine_friction", accepts="engine_brake accessory_load")
@sizes(gel_nm=(120.0, 260.0), thin_nm=(15.0, 50.0), breaks_rad=(1500.0, 5000.0), sets_s=(20.0, 60.0))
class GelledOil(Hidden):
    """Turning breaks the gel, slow running lets it set again. gel_nm: at 120 rad/s.
    Source: Mewis and Wagner, Thixotropy, Advances in Colloid and Interface Science 147 (2009): a structure
    that shear breaks and rest builds; waxy oil, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"gel": self.rng(821).uniform(0.6, 1.0, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        turns = np.maximum(view.engine_speed, 40.0)
        builds = (1.0 - s.gel) * np.exp(-turns / 60.0) / p.sets_s
        s.gel = np.clip(s.gel + dt * (4.0 * builds - turns * s.gel / p.breaks_rad / 4.0), 0.0, 1.0)
        torque = (p.thin_nm + p.gel_nm * (0.3 + 0.7 * s.gel)) * np.sqrt(turns / 120.0)
        return -self.at_wheels(view, torque) * moving(view)


@hidden(
    "s_steering_pump", "sealed", "highway suburban hills", name="accessory_load", accepts="engine_friction"
)
@sizes(torque_nm=(180.0, 380.0), idles_nm=(20.0, 60.0), tightest=(0.004, 0.01), slow_mps=(10.0, 18.0))
class SteeringPump(Bends, pressure=0.0):
    """The slower the truck, the harder the wheels turn.
    Source: Hydraulic steering takes pressure with the rack's force, which falls with speed (Harrer and
    Pfeffer, Steering Handbook, 2017, on hydraulic power steering); heavy axles, sizes are chosen here."""

    def prepare(self) -> None:
        self.bend = self.draw_bends(self.rng(822), self.p.tightest)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        steer = np.abs(self.read(self.bend, view)) / p.tightest
        wanted = np.clip(steer * (0.35 + p.slow_mps / np.maximum(view.speed, 4.0)), 0.0, 1.0)
        s.pressure = s.pressure + dt * (wanted - s.pressure) / 0.5
        return -self.at_wheels(view, p.idles_nm + p.torque_nm * s.pressure) * moving(view)


@hidden(
    "s_regulator_ices", "sealed", "hills highway", name="torque_derate", accepts="torque_gain", shown=True
)
@sizes(depth=(0.3, 0.55), ices_s=(15.0, 45.0), thaws_s=(15.0, 50.0), from_ice=(0.15, 0.35))
class RegulatorIces(Hidden, ice=0.0):
    """Flow of gas cools it, the coolant thaws it.
    Source: Expanding natural gas cools by the Joule-Thomson effect and can ice its regulator (Perry's
    Chemical Engineers' Handbook, on expansion); a heater that is too small, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        flow = np.clip(self.power_share(view), 0.0, 1.1)
        s.ice = np.clip(s.ice + dt * (flow**1.3 / p.ices_s - s.ice / p.thaws_s), 0.0, 2.0)
        cut = p.depth * np.clip((s.ice - p.from_ice) / 0.35, 0.0, 1.0)
        return -self.at_wheels(view, cut * np.maximum(view.engine_torque, 0.0))


@hidden("s_mean_power_capped", "sealed", "suburban hills", name="torque_limit", shown=True)
@sizes(cap=(0.35, 0.6), mean_s=(0.8, 4.0), knee=(0.04, 0.12))
class MeanPowerCapped(Hidden, mean=0.0):
    """cap: of peak power, for its mean of some seconds. Torque at low speed is free.
    Source: Leased ratings that cap power, not torque (SAE J1939-71, engine power limits): the fuel system
    holds a mean of flow; caps and times are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        asked = np.clip(self.power_share(view), 0.0, 1.2)
        s.mean = s.mean + dt * (asked - s.mean) / p.mean_s
        closed = np.clip((s.mean - p.cap) / p.knee, 0.0, 1.0)
        over = np.maximum(asked - p.cap, 0.0) * closed * self.truck.peak_power
        return -self.at_wheels(view, over / np.maximum(view.engine_speed, 60.0))


@hidden(
    "s_second_stage_waits", "sealed", "suburban hills", name="turbo_lag", accepts="command_rate_limit",
    shown=True,
)  # fmt: skip
@sizes(without=(0.15, 0.3), small_s=(0.6, 1.4), large_s=(2.5, 6.0), small=(0.25, 0.45))
class SecondStageWaits(Hidden, low=0.2, high=0.0):
    """small: share of full boost that the first stage can give. The second waits for the first.
    Source: Regulated two-stage turbocharging (Galindo, Serrano, Climent and Varnier, Energy Conversion and
    Management 51, 2010): a small and a large machine in a row; times are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        asked = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.1)
        wanted = np.clip((asked - p.without) / (1.0 - p.without), 0.0, 1.1)
        flow = np.clip(view.engine_speed / 130.0, 0.5, 1.6)
        first = np.minimum(wanted, p.small)
        s.low = s.low + dt * (first - s.low) * flow / np.where(first > s.low, p.small_s, 0.8)
        second = np.maximum(wanted - p.small, 0.0) * np.clip(s.low / p.small, 0.0, 1.0) ** 3
        s.high = s.high + dt * (second - s.high) * flow / np.where(second > s.high, p.large_s, 0.6)
        missing = np.maximum(asked - p.without - (1.0 - p.without) * (s.low + s.high), 0.0)
        return -self.at_wheels(view, missing * self.truck.peak_torque) * moving(view)


@hidden("s_vanes_brake", "sealed", "descent hills", name="engine_brake", accepts="engine_friction")
@sizes(power_w=(50e3, 130e3), most_nm=(450.0, 900.0), closes_s=(1.0, 4.0), from_rads=(90.0, 115.0))
class VanesBrake(Hidden, shut=0.0):
    """It regulates power, so that a lower gear does not brake more.
    Source: Turbocharger vanes that close for engine braking hold a set back power (Schmitz, Jochheim, Karch
    and Nagel, MTZ 55, 1994, on turbo brakes); control and sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        closed = (self.pedal(view) < 0.01) & (view.engine_speed > p.from_rads) & (view.speed > 3.0)
        s.shut = s.shut + dt * (closed - s.shut) / np.where(closed, p.closes_s, 0.2)
        torque = np.minimum(p.power_w / np.maximum(view.engine_speed, 60.0), p.most_nm)
        return -self.at_wheels(view, s.shut * torque) * moving(view)


@hidden("s_rail_bleeds", "sealed", "suburban hills highway", name="unknown")
@sizes(share=(0.4, 0.75), bleeds_s=(1.2, 3.5))
class RailBleeds(Hidden, rail=0.0):
    """Torque hangs on after the pedal is let go, and ends with the brake.
    Source: Rail pressure falls only through leakage and injection (Guzzella and Onder, Introduction to
    Modeling and Control of Internal Combustion Engine Systems, on common rail); a leaking injector, sizes
    are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        asked = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.1)
        brakes = view.brake_force > 0.0
        falls = s.rail - dt * s.rail / np.where(brakes, 0.2, p.bleeds_s)
        s.rail = np.maximum(asked, falls)
        more = p.share * np.maximum(s.rail - asked, 0.0) * self.truck.peak_torque
        return self.at_wheels(view, np.minimum(more, 0.4 * self.truck.peak_torque)) * moving(view)


@hidden("s_pedal_map", "sealed", "suburban hills highway", name="unknown", shown=True)
@sizes(bends=(0.12, 0.28), at=(0.3, 0.6), changes_s=(4.0, 15.0))
class PedalMap(Hidden, mode=0.0):
    """Brisk driving earns a sharp pedal, calm driving a dull one. bends: of peak torque.
    Source: Pedal maps adapted to the driver's style (Kiencke and Nielsen, Automotive Control Systems, 2005,
    on drive modes): less torque at part pedal, more with the style; sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        pedal = self.pedal(view)
        s.mode = s.mode + dt * ((pedal > p.at) - s.mode) / p.changes_s
        bend = p.bends * (2.5 * s.mode - 1.0) * np.sin(np.pi * pedal)
        return self.at_wheels(view, bend * self.truck.peak_torque) * moving(view)


@hidden("s_anti_stall", "sealed", "suburban hills", name="unknown", shown=True)
@sizes(below=(118.0, 135.0), per_rads=(12.0, 28.0), most=(0.15, 0.3), builds_s=(0.3, 1.0))
class AntiStall(Hidden, torque=0.0):
    """The lower the engine runs under load, the more is added. below: rad/s; per_rads: N m.
    Source: Low-speed torque support against lugging (Bosch, Diesel-Engine Management, on intermediate speed
    control); one that is set too high, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        loaded = np.clip(self.pedal(view) / 0.2, 0.0, 1.0)
        most = p.most * self.truck.peak_torque
        wanted = np.clip(p.per_rads * (p.below - view.engine_speed), 0.0, most) * loaded
        s.torque = s.torque + dt * (wanted - s.torque) / p.builds_s
        return self.at_wheels(view, s.torque * loaded) * moving(view)
