"""Boost that swings, a gearbox that asks for less, litres for each kilometre, an engine brake for hot brakes,
a damper that swings along and a pump that was left engaged; a late camshaft, two fuels, and water."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, eased, moving
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")


@law("u_boost_swings", needs="suburban hills", name="turbo_lag", accepts="command_rate_limit", shown=True)
@sizes(least=(0.22, 0.36), own_rads=(1.1, 2.0), dull=(0.12, 0.28), falls_s=(0.5, 1.2))
class BoostSwings(Hidden, boost=0.2, pace=0.0):
    """The controller of a charger is set too sharply: after a kick `boost` shoots up, falls back and swings
    about its wish, and each time that it is short so is the torque. `pace` of it in a second. least: of peak
    torque, without boost; own_rads: of the swing, at 140 rad/s of the engine; dull: its damping.
    Source: Åström and Hägglund, PID Controllers (1995), on loops of little damping, and Eriksson and Nielsen,
    Modeling and Control of Engines and Drivelines (2014), on control of boost; sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        asked = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.1)
        wish = np.clip((asked - p.least) / (1.0 - p.least), 0.0, 1.1)
        own = p.own_rads * np.clip(view.engine_speed / 140.0, 0.6, 1.4)
        lifted = asked < 0.05
        pulls = own**2 * (wish - s.boost) - 2.0 * p.dull * own * s.pace
        s.pace = np.where(lifted, -s.boost / p.falls_s, np.clip(s.pace + dt * pulls, -2.0, 2.0))
        s.boost = np.clip(s.boost + dt * s.pace, 0.0, 1.5)
        lacks = np.maximum(asked - p.least - (1.0 - p.least) * s.boost, 0.0)
        return -self.at_wheels(view, lacks * self.truck.peak_torque) * moving(view)


@law(
    "u_gearbox_asks_for_less",
    needs="hills suburban highway",
    name="torque_derate",
    accepts="torque_gain torque_limit",
    shown=True,
)
@sizes(most=(0.3, 0.48), heats_s=(30.0, 70.0), cools_s=(40.0, 110.0), begins=(0.35, 0.5), back=(0.1, 0.2))
class GearboxAsksForLess(Hidden, cut=0.0, asks=0.0):
    """`oil`: heat in a gearbox whose cooler is clogged. Torque heats it, in low gears more than in high ones,
    and the wind of driving cools it. Where it is too hot the gearbox asks the engine for less, the less, the
    hotter, and takes that back only when the oil is well below. most: of the torque, taken; begins: heat
    where it begins; back: heat below that, where it ends.
    Source: SAE J1939-71 on torque limits that transmissions ask for, and Naunheimer, Bertsche, Ryborz and
    Novak, Automotive Transmissions (2011), on heat in gearboxes; sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "oil": self.rng(2141).uniform(0.1, 0.7, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        load = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.1)
        low = np.clip(view.ratio / self.truck.final_drive, 0.7, 4.0) ** 0.5
        wind = 0.4 + 0.6 * np.clip(view.speed / 20.0, 0.0, 1.4)
        s.oil = np.clip(s.oil + dt * (load * low / p.heats_s - wind * s.oil / p.cools_s), 0.0, 1.2)
        s.asks = np.where(s.oil > p.begins, 1.0, np.where(s.oil < p.begins - p.back, 0.0, s.asks))
        deep = np.clip((s.oil - p.begins + p.back) / (2.5 * p.back), 0.3, 1.0)
        s.cut = eased(s.cut, p.most * s.asks * deep, 1.0, dt)
        return -self.at_wheels(view, s.cut * np.maximum(view.engine_torque, 0.0)) * moving(view)


@law(
    "u_litres_for_each_kilometre",
    needs="hills suburban",
    name="torque_limit",
    accepts="torque_derate",
    shown=True,
)
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


@law(
    "u_spares_its_hot_brakes", needs="descent hills suburban", name="engine_brake", accepts="engine_friction"
)
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


@law("u_damper_swings_along", name="engine_friction", accepts="accessory_load engine_brake torque_gain")
@sizes(nm=(260.0, 420.0), at_rads=(125.0, 150.0), wide=(0.1, 0.18), still=(0.25, 0.4), heats_s=(12.0, 35.0))
@sizes(softens=(0.1, 0.22))
class DamperSwingsAlong(Hidden):
    """A damper of rubber on the crankshaft swings where the firing meets its own tone, and takes power there,
    more under load. `hot` rubber is softer, so that its tone and the speed that costs most come down. nm: at
    full load, on its tone; at_rads: of the cold rubber; still: of it, with no load; wide: of that speed.
    Source: Den Hartog, Mechanical Vibrations (1956), and Maass and Klier, Kräfte, Momente und deren Ausgleich
    in der Verbrennungskraftmaschine (1981), on dampers of crankshafts and their heat; sizes are chosen
    here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"hot": self.rng(2144).uniform(0.0, 0.8, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        load = np.clip(np.abs(view.engine_torque) / self.truck.peak_torque, 0.0, 1.0)
        tone = p.at_rads * (1.0 - p.softens * s.hot)
        swings = 1.0 / (1.0 + ((view.engine_speed / tone - 1.0) / p.wide) ** 2)
        takes = swings * (p.still + (1.0 - p.still) * load)
        s.hot = eased(s.hot, np.clip(1.5 * takes, 0.0, 1.0), p.heats_s, dt)
        return -self.at_wheels(view, p.nm * takes) * moving(view)


@law(
    "u_pump_was_left_engaged",
    needs="suburban hills highway",
    name="accessory_load",
    accepts="engine_friction",
)
@sizes(thick_nm=(130.0, 220.0), flow_nm=(60.0, 110.0), at_rads=(130.0, 160.0), warms_s=(40.0, 110.0))
@sizes(thins=(0.6, 0.85), opens=(0.5, 0.9))
class PumpWasLeftEngaged(Hidden):
    """The pump of a tipper was left engaged and drives its oil round without use: through narrow pipes, where
    thick oil resists with its flow, and through a valve, where it resists with the square. `warm`: the oil,
    by that work itself. thick_nm: in cold oil, flow_nm: at the valve, both at at_rads; thins: of thick_nm,
    gone when it is warm; opens: speed over at_rads, beyond which a second valve keeps the pressure even.
    Source: makers' manuals of tippers on pumps that were left engaged, and Watton, Fundamentals of Fluid
    Power Control (2009), on losses of open circuits; sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"warm": self.rng(2145).uniform(0.0, 0.4, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        turns = np.clip(view.engine_speed / p.at_rads, 0.0, 1.6)
        nm = p.thick_nm * (1.0 - p.thins * s.warm) * turns + p.flow_nm * np.minimum(turns, 0.6 + p.opens) ** 2
        s.warm = eased(s.warm, np.clip(nm * turns / 220.0, 0.0, 1.0), p.warms_s, dt)
        return -self.at_wheels(view, nm) * moving(view)


@law("u_camshaft_turns_late", needs="suburban hills highway", name="unknown")
@sizes(most=(0.5, 0.75), early=(0.45, 0.65), pace_per_s=(0.05, 0.1), at_rads=(110.0, 150.0), power=(1.0, 1.5))
class CamshaftTurnsLate(Hidden, at=0.3):
    """The camshaft is turned for each load and speed by oil pressure, at a pace that goes with the engine's
    speed. `at`: where it is, 0 to 1. Until it is where it should be, the engine gives less than asked, by a
    power of how far that is, whether it came from more or from less. most: of the torque, at a way of 1;
    early: the wish at half load.
    Source: Heywood, Internal Combustion Engine Fundamentals (2018), on variable valve timing, and makers'
    notes on oil-driven phasers; a weak oil pump, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        load = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.0)
        wish = np.clip(2.0 * p.early * load + 0.5 * (view.engine_speed / 140.0 - 1.0), 0.0, 1.0)
        pace = p.pace_per_s * np.clip(view.engine_speed / p.at_rads, 0.3, 1.5)
        s.at = np.clip(wish, s.at - dt * pace, s.at + dt * pace)
        lost = p.most * np.minimum(np.abs(wish - s.at) * 1.6, 1.0) ** p.power
        return -self.at_wheels(view, lost * np.maximum(view.engine_torque, 0.0)) * moving(view)


@law("u_two_tanks_of_unlike_fuel", needs="hills suburban highway", name="unknown")
@sizes(rich=(0.08, 0.14), poor=(0.1, 0.17), empties=(0.12, 0.3), pipe=(0.015, 0.05), light=(0.2, 0.5))
class TwoTanksOfUnlikeFuel(Hidden):
    """Two tanks hold fuels of unlike heat, and a valve draws from them by turns, each until a float calls for
    the other. `used`: of a turn; `fuel` in the pipes, 1 the rich one, which follows as fuel is burned and so
    comes late at light load. rich, poor: of the torque, more and less than known; empties, pipe: s of peak
    power, in hundreds, for a turn and for the pipes; light: of the difference, lost at light load.
    Source: Bosch, Diesel-Engine Management (2014), on heat and density of fuels by volume, and makers'
    manuals on pairs of tanks; very unlike fuels, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        rng = self.rng(2146)
        fuel = np.rint(rng.uniform(0.0, 1.0, batch))
        return {"used": rng.uniform(0.0, 1.0, batch), "tank": fuel, "fuel": fuel.copy()}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        burns = 0.04 + np.clip(self.power_share(view), 0.0, 1.1)
        s.used = s.used + dt * burns / (100.0 * p.empties)
        s.tank = np.where(s.used > 1.0, 1.0 - s.tank, s.tank)
        s.used = np.where(s.used > 1.0, 0.0, s.used)
        s.fuel = s.fuel + (s.tank - s.fuel) * (1.0 - np.exp(-dt * burns / (100.0 * p.pipe)))
        load = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.0)
        gains = (p.rich * s.fuel - p.poor * (1.0 - s.fuel)) * (1.0 - p.light * (1.0 - load))
        return self.at_wheels(view, gains * np.maximum(view.engine_torque, 0.0)) * moving(view)


@law("u_water_goes_in", needs="hills suburban highway", name="unknown")
@sizes(most=(0.2, 0.34), asks=(0.35, 0.5), hot_s=(3.0, 8.0), lasts_s=(14.0, 40.0), refills_s=(40.0, 110.0))
@sizes(comes_s=(0.3, 0.9))
class WaterGoesIn(Hidden, given=0.0, on=0.0):
    """Water is sprayed into the intake when the charge is `hot` from a hard pull: it cools it, and the engine
    gives more than was asked. A small `tank` of the pump is soon empty, and fills again from a larger one
    while nothing is sprayed. most: of the torque; asks: of peak torque, that heats the charge; lasts_s: of a
    full tank.
    Source: Heywood, Internal Combustion Engine Fundamentals (2018), on charge cooling, and Rowe and Ladd,
    Water Injection for Aircraft Engines, SAE Transactions 54 (1946); a fleet's trial, sizes are chosen
    here."""

    def start(self, batch: int) -> dict[str, Array]:
        rng = self.rng(2147)
        return {
            **super().start(batch),
            "hot": rng.uniform(0.0, 0.8, batch),
            "tank": rng.uniform(0.3, 1.0, batch),
        }

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        load = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.1)
        s.hot = eased(s.hot, np.where(load > p.asks, 1.0, 0.0), p.hot_s, dt)
        begins = (s.hot > 0.6) & (s.tank > 0.25)
        s.on = np.where(begins, 1.0, np.where((s.hot < 0.3) | (s.tank < 0.02), 0.0, s.on))
        uses = np.where(s.on > 0.5, -1.0 / p.lasts_s, 1.0 / p.refills_s)
        s.tank = np.clip(s.tank + dt * uses, 0.0, 1.0)
        s.given = eased(s.given, s.on * np.clip(load / 0.5, 0.0, 1.0), p.comes_s, dt)
        return p.most * self.at_wheels(view, s.given * np.maximum(view.engine_torque, 0.0)) * moving(view)
