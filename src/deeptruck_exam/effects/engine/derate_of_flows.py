"""Torque that is taken back where fuel, air or exhaust gas does not flow as it should."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import GRAVITY, Array, Hidden, Sizes, State, eased, moving
from deeptruck_exam.effects.places import OnRoad, windows
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, name="torque_derate", accepts="torque_gain", shown=True)


@law("clogged_filter", "third", "hills highway")
@sizes(depth=(0.35, 0.60), flow_power=(0.6, 1.2), loads_s=(150.0, 400.0), burns=(0.5, 2.0))
class CloggedFilter(Hidden):
    """Every drive begins with the soot of the last; it burns while much is asked.
    Source: Back pressure of a loaded particulate filter, Konstandopoulos and others, Fundamental Studies of
    Diesel Particulate Filters, SAE 2000-01-1016: resistance of the soot times the flow; loss of torque with
    back pressure, loading and burning off are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"soot": self.rng(210).uniform(0.35, 1.0, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        flow = np.clip(self.power_share(view), 0.0, 1.2)
        burning = p.burns * np.clip((flow - 0.7) / 0.2, 0.0, 1.0) * s.soot
        s.soot = np.clip(s.soot + dt * (0.3 + flow - 2.0 * burning) / p.loads_s, 0.1, 1.0)
        cut = p.depth * s.soot * flow**p.flow_power
        return -self.at_wheels(view, cut * np.maximum(view.engine_torque, 0.0))


@law("wax_in_the_filter", "fifth", "hills highway", shown=False)
@sizes(depth=(0.35, 0.6), clogs_s=(12.0, 35.0), clears_s=(40.0, 110.0), starves=(0.25, 0.5))
class WaxInTheFilter(Hidden):
    """starves: power, of the engine's most, that fresh wax still lets through.
    Source: Waxing of diesel below its cloud point (EN 116, cold filter plugging): the filter passes less the
    more has flowed, warm return fuel clears it again, and rail pressure falls with what is lacking (workshop
    notes on loss of power in frost); rates and sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"wax": self.rng(451).uniform(0.0, 0.6, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        torque = np.maximum(view.engine_torque, 0.0)
        flow = np.clip(torque * view.engine_speed / self.truck.peak_power, 0.0, 1.2)
        grows = np.maximum(flow - p.starves * s.wax, 0.0) * (1.0 - s.wax) / p.clogs_s
        s.wax = np.clip(s.wax + dt * (grows - s.wax * (1.2 - flow) / p.clears_s), 0.0, 1.0)
        lost = p.depth * s.wax * np.clip(flow / p.starves, 0.0, 1.5) / 1.5
        return -self.at_wheels(view, lost * torque)


@law("s_regulator_ices", "eighth", "hills highway")
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


@law("w_fuel_comes_back_hot", "twelfth", "hills highway")
@sizes(thins=(0.18, 0.32), cuts=(0.3, 0.45), heats_s=(20.0, 55.0), cools_s=(70.0, 200.0), feels_s=(5.0, 20.0))
class FuelComesBackHot(Hidden):
    """`tank`, `pump`: heat of fuel, 0 as the air to about 1, where torque is cut. What the injectors return
    heats a tank that is nearly empty, the wind of driving cools it; thin fuel gives less, too hot fuel is
    protected. thins: of the torque, at 1; cuts: of it, beyond.
    Source: Bosch, Diesel Engine Management (2014), on return flow and power by fuel temperature; a tank that
    is nearly empty, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        first = self.rng(1141).uniform(0.2, 0.95, batch)
        return {"tank": first, "pump": first.copy()}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        wind = 0.5 + np.clip(view.speed / 20.0, 0.0, 1.3)
        turns = 0.25 * np.clip(view.engine_speed / 150.0, 0.3, 1.5)
        gains = (turns + self.power_share(view)) / p.heats_s
        s.tank = np.clip(s.tank + dt * (gains - wind * s.tank / p.cools_s), 0.0, 1.6)
        s.pump = s.pump + dt * (s.tank - s.pump) / p.feels_s
        cut = p.thins * np.clip(s.pump, 0.0, 1.2) ** 2 + p.cuts * np.clip((s.pump - 0.9) / 0.25, 0.0, 1.0)
        return -self.at_wheels(view, np.minimum(cut, 0.7) * np.maximum(view.engine_torque, 0.0)) * moving(
            view
        )


@law("x_shaking_cools_the_gas", "thirteenth", "hills suburban highway")
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


@law("k_snow_in_the_air_filter", "fourteenth", "hills suburban highway")
@sizes(most=(0.4, 0.6), fills_s=(25.0, 70.0), melts_s=(25.0, 70.0), mean_m=(300.0, 1000.0), snow=(0.4, 0.6))
class SnowInTheAirFilter(OnRoad):
    """`clog` of the air filter. Where snow blows over the road the engine draws it in with its air; slow
    driving lets heat under the cab melt it, and out of the snow it dries. A clogged filter takes torque where
    much air is needed. most: of the torque; snow: of the road.
    Source: ISO 5011 on restriction of air cleaners over flow and loading; snow, places and times are chosen
    here."""

    def prepare(self) -> None:
        self.road = windows(self.rng(1441), self.rows(), self.p.mean_m, self.p.snow)

    def start(self, batch: int) -> dict[str, Array]:
        return {"clog": self.rng(1442).uniform(0.1, 0.8, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        load = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.0)
        flow = np.clip(view.engine_speed / 150.0, 0.3, 1.4) * (0.4 + 0.6 * load)
        snow = self.between(self.road, view)
        fills = snow * flow / p.fills_s
        melts = (0.15 + 0.85 * np.clip(1.0 - view.speed / 12.0, 0.0, 1.0) + 0.7 * (1.0 - snow)) / p.melts_s
        s.clog = eased(s.clog, fills / (fills + melts), 1.0 / (fills + melts), dt)
        cut = p.most * np.clip(1.3 * s.clog * flow - 0.15, 0.0, 1.0)
        return -self.at_wheels(view, cut * np.maximum(view.engine_torque, 0.0)) * moving(view)


@law("q_soot_chokes_it", "fifteenth", "suburban hills")
@sizes(
    most=(0.24, 0.4), fills_s=(50.0, 140.0), burns_s=(25.0, 70.0), warms_s=(15.0, 45.0), lights=(0.5, 0.65)
)
class SootChokesIt(Hidden):
    """`soot` in a filter, 1 where the engine is protected by less torque; `hot`: the filter. Gentle driving
    fills it, and only a hot filter burns it free again, which takes long pulls. most: of the torque, taken
    where much gas has to pass; lights: of the heat at full power, where soot burns.
    Source: Johnson, Diesel Emissions in Review, SAE 2011-01-0304, and Heywood, Internal Combustion Engine
    Fundamentals (2018), on filters that burn themselves free and on back pressure; sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        rng = self.rng(1541)
        return {"soot": rng.uniform(0.4, 1.0, batch), "hot": rng.uniform(0.2, 0.6, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        power = np.clip(self.power_share(view), 0.0, 1.0)
        s.hot = eased(s.hot, np.sqrt(power), p.warms_s, dt)
        burns = np.clip((s.hot - p.lights) / 0.15, 0.0, 1.0) / p.burns_s
        s.soot = np.clip(s.soot + dt * ((0.3 + 0.7 * power) / p.fills_s - burns * s.soot), 0.0, 1.2)
        load = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.0)
        gas = np.clip(view.engine_speed / 140.0, 0.3, 1.4) * (0.3 + 0.7 * load)
        cut = np.minimum(p.most * np.clip((s.soot - 0.4) / 0.6, 0.0, 1.2) * gas, 0.8)
        return -self.at_wheels(view, cut * np.maximum(view.engine_torque, 0.0)) * moving(view)


@law("z_cooler_spits_water", "seventeenth", "suburban hills")
@sizes(most=(0.4, 0.6), gathers_s=(15.0, 45.0), blows=(0.3, 0.45), sweeps_s=(2.0, 5.0), dries_s=(3.0, 7.0))
class CoolerSpitsWater(Hidden, wet=0.0):
    """`pool` of water at the bottom of a charge cooler: moist air leaves it there as long as little is asked.
    When the flow grows it is swept on into the engine, which misfires for some seconds, the more the longer
    it was driven gently. `wet`: the cylinders. most: of the torque, lost when quite wet; blows: of full flow,
    that begins to sweep.
    Source: Ford, Technical Service Bulletin 13-8-1, on water in charge coolers that makes engines surge when
    more is asked after steady driving in humid air; a truck's cooler, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "pool": self.rng(1741).uniform(0.2, 1.0, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        load = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.1)
        flow = load * np.clip(view.engine_speed / 150.0, 0.3, 1.4)
        sweeps = np.clip((flow - p.blows) / 0.2, 0.0, 1.0) * s.pool / p.sweeps_s
        gathers = np.clip((p.blows - flow) / p.blows, 0.0, 1.0) * (1.0 - s.pool) / p.gathers_s
        s.pool = np.clip(s.pool + dt * (gathers - sweeps), 0.0, 1.0)
        s.wet = np.clip(s.wet + dt * (2.0 * sweeps * (1.0 - s.wet) - s.wet / p.dries_s), 0.0, 1.0)
        return -self.at_wheels(view, p.most * s.wet * np.maximum(view.engine_torque, 0.0)) * moving(view)


@law("h_oil_foams", "nineteenth", "hills suburban highway")
@sizes(
    most=(0.35, 0.55),
    above_rads=(105.0, 130.0),
    foams_s=(4.0, 12.0),
    bursts_s=(15.0, 45.0),
    least=(0.15, 0.3),
)
class OilFoams(Hidden):
    """`foam` in an oil that has lost its additives: a fast crankshaft beats air into it, and it bursts slowly
    where the engine turns slowly. Bearings get less pressure, and the controller takes torque back until the
    foam is gone. most: of the torque, taken; above_rads: of the engine; least: foam that is borne.
    Source: Mortier, Fox and Orszulik, Chemistry and Technology of Lubricants (2010), on foam and its decay,
    and makers' manuals on protection by oil pressure; sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"foam": self.rng(1941).uniform(0.0, 0.7, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        beats = np.clip((view.engine_speed - p.above_rads) / 40.0, 0.0, 1.5)
        s.foam = np.clip(s.foam + dt * (beats * (1.0 - s.foam) / p.foams_s - s.foam / p.bursts_s), 0.0, 1.0)
        taken = p.most * np.clip((s.foam - p.least) / (0.8 - p.least), 0.0, 1.0)
        return -self.at_wheels(view, taken * np.maximum(view.engine_torque, 0.0)) * moving(view)


@law("b_relief_valve_stays_open", "twentieth", "suburban hills", accepts="torque_gain torque_limit")
@sizes(most=(0.35, 0.55), quick_per_s=(0.45, 0.8), rests_s=(3.0, 8.0), opens_s=(0.3, 0.9), warm=(0.2, 0.5))
class ReliefValveStaysOpen(Hidden, was=-1.0, rested=0.0, opened=0.0, lost=0.0):
    """A valve on the fuel rail opens when pressure overshoots, after a quick kick of torque, and stays open:
    the controller takes torque back, whatever is asked. It shuts only when little has been asked for some
    seconds. most: of the torque, taken; quick_per_s: rise of torque that opens it, of the peak; rests_s:
    until it shuts; warm: of what is taken, less at low engine speed.
    Source: Bosch, Diesel-Engine Management (2014), on pressure-relief valves of common rails, and makers'
    notes on running with an open one; a weak valve, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        opened = np.rint(self.rng(2041).uniform(0.0, 1.0, batch))
        return {**super().start(batch), "opened": opened}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        load = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.1)
        s.was = np.where(s.was < 0.0, load, s.was)
        lagging = eased(s.was, load, 0.25, dt)
        quick = (load - s.was) / 0.25
        s.was = lagging
        s.rested = np.where(load < 0.12, s.rested + dt, 0.0)
        s.opened = np.where(quick > p.quick_per_s, 1.0, np.where(s.rested > p.rests_s, 0.0, s.opened))
        slow = np.clip(1.0 - view.engine_speed / 160.0, 0.0, 0.6)
        s.lost = eased(s.lost, p.most * s.opened * (1.0 - p.warm * slow), p.opens_s, dt)
        return -self.at_wheels(view, s.lost * np.maximum(view.engine_torque, 0.0)) * moving(view)
