"""Burnt gas in a long pipe, cold gas that shakes, an engine brake that cools, fuel in the oil, a catalyst
that is heated, a turbine on the shaft, and fuel on the walls."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import GRAVITY, Array, Hidden, Sizes, State, moving
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_exam.effects.series import spells, within
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")


@law(
    "x_pipe_holds_burnt_gas",
    needs="suburban hills",
    name="turbo_lag",
    accepts="command_rate_limit",
    shown=True,
)
@sizes(burnt=(0.5, 0.75), clears_s=(0.5, 1.1), valve_s=(0.3, 0.8), boosts_s=(0.7, 1.6), least=(0.2, 0.35))
class PipeHoldsBurntGas(Hidden, valve=1.0, near=1.0, mid=1.0, far=1.0, boost=0.0):
    """Exhaust that is led back fills the long pipe to the engine at part load. When more is asked the valve
    shuts, but the engine has to breathe what is in the pipe: `near` the valve, `mid` and `far` along it. It
    breathes the slower, the lower the boost, and smoke limits torque until air has come. burnt: torque that
    burnt gas takes; clears_s: of a third of the pipe; least: of peak torque, without boost.
    Source: Wahlstrom and Eriksson, Modelling Diesel Engines with a Variable-Geometry Turbocharger and Exhaust
    Gas Recirculation, Proc. IMechE D 225 (2011), on oxygen in the intake, and Heywood, Internal Combustion
    Engine Fundamentals (2018), on transport in manifolds; a long route, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        asked = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.1)
        s.boost = s.boost + dt * (asked - s.boost) / np.where(asked > s.boost, p.boosts_s, 0.5)
        shut = np.clip((asked - 0.3) / 0.25, 0.0, 1.0)
        s.valve = s.valve + dt * (1.0 - shut - s.valve) / p.valve_s
        flow = np.clip(view.engine_speed / 130.0, 0.4, 1.5) * (0.5 + s.boost) / p.clears_s
        s.far = s.far + dt * flow * (s.mid - s.far)
        s.mid = s.mid + dt * flow * (s.near - s.mid)
        s.near = s.near + dt * flow * (s.valve - s.near)
        most = (p.least + (1.1 - p.least) * np.clip(1.15 * s.boost, 0.0, 1.0)) * (1.0 - p.burnt * s.far)
        lacks = np.maximum(asked - most, 0.0) * self.truck.peak_torque
        return -self.at_wheels(view, lacks) * moving(view)


@law(
    "x_shaking_cools_the_gas",
    needs="hills suburban highway",
    name="torque_derate",
    accepts="torque_gain",
    shown=True,
)
@sizes(most=(0.4, 0.65), falls=(0.04, 0.12), builds_s=(40.0, 120.0), draws_s=(150.0, 400.0), knee=(0.5, 0.7))
@sizes(feels_s=(0.6, 1.5))
class ShakingCoolsTheGas(Hidden, felt=0.0):
    """`bar`: pressure of the gas over liquid in a tank of cold gas, of the usual one. Sloshing brings cold
    liquid to the gas, which condenses, and the pressure falls in seconds; heat raises it again in minutes,
    and the engine draws on it. Below the knee torque is cut. most: of the torque; falls: of the pressure, in
    a second at 1 m/s2 of change.
    Source: Moran, McNelis, Kudlac, Haberbusch and Satornino, Experimental Results of Hydrogen Slosh in a 62
    Cubic Foot Tank, AIAA 94-3259 (1994): pressure collapse by slosh; a tank of natural gas on a truck, sizes
    are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "bar": self.rng(1341).uniform(0.45, 1.0, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        along = np.clip(view.acceleration + GRAVITY * view.grade, -3.0, 3.0)
        s.felt = s.felt + dt * (along - s.felt) / p.feels_s
        slosh = np.minimum(np.abs(along - s.felt), 1.5)
        gains = (1.1 - s.bar) / p.builds_s - self.power_share(view) * s.bar / p.draws_s
        s.bar = np.clip(s.bar + dt * (gains - p.falls * slosh * np.maximum(s.bar - 0.25, 0.0)), 0.2, 1.0)
        cut = p.most * np.clip((p.knee + 0.25 - s.bar) / 0.3, 0.0, 1.0)
        return -self.at_wheels(view, cut * np.maximum(view.engine_torque, 0.0)) * moving(view)


@law("x_brakes_with_hot_gas", needs="descent hills suburban", name="engine_brake", accepts="engine_friction")
@sizes(share=(0.6, 0.95), cools_s=(15.0, 45.0), heats_s=(8.0, 25.0), left=(0.2, 0.4), waits_s=(0.4, 1.2))
@sizes(fills_s=(0.4, 1.0))
class BrakesWithHotGas(Hidden, shut=0.0, on=0.0, heat=0.5):
    """A switch that was left on: when the pedal is up the engine brakes, by gas that its turbine holds back.
    Behind a climb hot gas and a fast turbine brake strongly; without fuel both cool, and the brake fades away
    while nobody touches anything. share: of the engine brake's torque; left: of it, all cold.
    Source: Hu, Israel and Vorih, Variable Valve Actuation and Diesel Engine Retarding Performance, SAE
    970343, and Heisler, Advanced Engine Technology (1995), on exhaust manifold pressure in retarding; sizes
    are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        power = np.clip(1.6 * self.power_share(view), 0.0, 1.0)
        s.heat = s.heat + dt * (power - s.heat) / np.where(power > s.heat, p.heats_s, p.cools_s)
        s.shut = np.where(self.pedal(view) < 0.02, s.shut + dt, 0.0)
        wants = (s.shut > p.waits_s) * np.clip((view.engine_speed - 85.0) / 15.0, 0.0, 1.0)
        s.on = s.on + dt * (wants - s.on) / np.where(wants > s.on, p.fills_s, 0.15)
        turns = np.clip(view.engine_speed / 190.0, 0.0, 1.3) ** 1.4
        torque = p.share * self.truck.engine_brake_torque * turns * (p.left + (1.0 - p.left) * s.heat)
        return -self.at_wheels(view, s.on * torque) * np.clip(view.speed / 3.0, 0.0, 1.0)


@law("x_fuel_is_in_the_oil", name="engine_friction", accepts="engine_brake accessory_load")
@sizes(rubs_nm=(110.0, 220.0), meets_s=(50.0, 140.0), leaves_s=(60.0, 200.0), film=(110.0, 150.0))
@sizes(power=(1.2, 2.0), clean=(0.1, 0.3))
class FuelIsInTheOil(Hidden, late=0.0):
    """`fuel` in the oil, of the most. In spells fuel is sprayed late to burn out a filter; at light load much
    of it runs down the liners, and hard work boils it off. Thin oil gives way where the engine turns slowly
    under load: metals rub there. rubs_nm: at idle and full load, all thin; film: rad/s that carry a film;
    clean: of it, with no fuel.
    Source: Andreae, Fang and Bhandary, Biodiesel and Fuel Dilution of Engine Oil, SAE 2007-01-4036, and
    Taylor and Coy, Improved Fuel Efficiency by Lubricant Design: A Review, Proc. IMechE J 214 (2000), on
    boundary friction with thin oils; quicker, sizes are chosen here."""

    def prepare(self) -> None:
        self.burns = spells(self.rng(1342), self.setting.batch, (30.0, 100.0), (30.0, 120.0))

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "fuel": self.rng(1343).uniform(0.0, 1.0, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        power = np.clip(self.power_share(view), 0.0, 1.0)
        sprays = within(self.burns, view.time) * np.clip(1.2 - 2.0 * power, 0.0, 1.0)
        s.late = s.late + dt * (sprays - s.late) / 5.0
        gains = s.late * (1.0 - s.fuel) / p.meets_s - 2.5 * power * s.fuel / p.leaves_s
        s.fuel = np.clip(s.fuel + dt * gains, 0.0, 1.0)
        load = 0.35 + 0.65 * np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.0)
        thin = 1.0 / (1.0 + (np.maximum(view.engine_speed, 30.0) / p.film) ** (2.0 * p.power))
        torque = 2.0 * p.rubs_nm * (p.clean + (1.0 - p.clean) * s.fuel) * load * thin
        return -self.at_wheels(view, torque) * moving(view)


@law("x_heats_its_catalyst", needs="suburban descent hills", name="accessory_load", accepts="engine_friction")
@sizes(kw=(18.0, 34.0), warms_s=(25.0, 70.0), chills_s=(40.0, 110.0), on=(0.45, 0.6), off=(0.75, 0.95))
@sizes(ramps_s=(0.5, 1.5), spares=(0.2, 0.5))
class HeatsItsCatalyst(Hidden, heats=0.0, load=0.0):
    """`cat`: heat of a catalyst, 1 where it works well. The gas of a working engine warms it, the air that a
    coasting engine pumps through chills it, and a generator heats it whenever it is too cold, less while the
    driver pulls hard. kw: of the shaft, for a 20 t truck; spares: of that, left at full pull.
    Source: MECA, Technology Feasibility for Heavy-Duty Diesel Trucks in Achieving 90% Lower NOx Standards in
    2027 (2020), on heated catalysts, and Guzzella and Onder, Introduction to Modeling and Control of Internal
    Combustion Engine Systems (2010), on heat of converters; two heaters, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "cat": self.rng(1344).uniform(0.2, 0.9, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        power = np.clip(self.power_share(view), 0.0, 1.0)
        flow = np.clip(view.engine_speed / 150.0, 0.2, 1.4)
        gas = np.clip(2.2 * power, 0.0, 1.3)
        gains = np.where(gas > s.cat, (gas - s.cat) * (0.4 + flow) / p.warms_s, 0.0)
        loss = flow * np.maximum(s.cat - gas, 0.0) / p.chills_s
        s.cat = np.clip(s.cat + dt * (gains - loss + 0.008 * s.load), 0.0, 1.3)
        s.heats = np.where(s.cat < p.on, 1.0, np.where(s.cat > p.off, 0.0, s.heats))
        s.load = s.load + dt * (s.heats - s.load) / p.ramps_s
        hard = np.clip(self.pedal(view) / 0.8, 0.0, 1.0)
        size = np.clip(view.mass / 20000.0, 0.3, 1.3)
        watts = 1000.0 * p.kw * size * s.load * (1.0 - (1.0 - p.spares) * hard**2)
        torque = np.minimum(watts / np.maximum(view.engine_speed, 70.0), 230.0)
        return -self.at_wheels(view, torque) * moving(view)


@law("x_turbine_on_the_shaft", needs="hills highway suburban", name="unknown")
@sizes(adds=(0.18, 0.3), gas_s=(4.0, 14.0), drags_nm=(60.0, 120.0), lit=(0.15, 0.35), oil_s=(0.5, 1.5))
class TurbineOnTheShaft(Hidden, gas=0.0, turns=0.0):
    """A turbine in the exhaust turns the crankshaft through gears and a fluid coupling. `gas`: its energy,
    which comes as the manifolds warm and stays for a while when the pedal is up; a turbine without gas has
    to be dragged along. adds: of peak torque, at full power; lit: of `gas`, where it pays.
    Source: Hopmann and Algrain, Diesel Engine Electric Turbo Compound Technology, SAE 2003-01-2294, and
    Greszler, Diesel Turbo-Compound Technology, ICCT/NESCCAF Workshop (2008), on gain at load and loss in
    coasting; sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        power = np.clip(1.2 * self.power_share(view), 0.0, 1.1)
        s.gas = s.gas + dt * (power - s.gas) / p.gas_s
        speed = np.clip(view.engine_speed / 140.0, 0.0, 1.5)
        gains = p.adds * self.truck.peak_torque * np.maximum(s.gas - p.lit, 0.0) / (1.0 - p.lit)
        drags = p.drags_nm * speed**2 * np.clip((p.lit - s.gas) / p.lit, 0.0, 1.0)
        wants = gains * np.clip(speed / 0.6 - 0.3, 0.0, 1.0) - drags
        s.turns = s.turns + dt * (wants - s.turns) / p.oil_s
        return self.at_wheels(view, s.turns) * np.clip(view.speed - 1.0, 0.0, 1.0)


@law("x_fuel_wets_the_walls", needs="suburban hills", name="unknown")
@sizes(wets=(0.45, 0.7), cold_s=(2.0, 4.5), warm_s=(0.8, 1.6), warms_s=(60.0, 200.0), most=(0.5, 0.8))
class FuelWetsTheWalls(Hidden, film=0.0, warm=0.0):
    """`film` of a second fuel on the walls of the intake, as the torque that passes through it: part of what
    is sprayed stays there, and comes off with delay. Torque comes late when more is asked, and goes on when
    the pedal is let go. wets: of that fuel; cold_s, warm_s: until it is off; most: of the torque by it.
    Source: Aquino, Transient A/F Control Characteristics of the 5 Liter Central Fuel Injection Engine, SAE
    810494: share and time constant of the film; alcohol beside diesel (fumigation), sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        power = np.clip(self.power_share(view), 0.0, 1.0)
        s.warm = s.warm + dt * (0.2 + power) * (1.0 - s.warm) / p.warms_s
        stays_s = p.cold_s + (p.warm_s - p.cold_s) * s.warm
        by_it = p.most * np.maximum(view.engine_torque, 0.0)
        flow = np.clip(view.engine_speed / 130.0, 0.4, 1.5)
        s.film = s.film + dt * flow * (by_it - s.film) / stays_s
        late = p.wets * (s.film - by_it)
        return self.at_wheels(view, late) * np.clip(view.speed - 1.0, 0.0, 1.0)
