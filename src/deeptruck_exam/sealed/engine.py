"""A blower behind a coupling, oil that foams, plungers that leak, and a resistor that glows; oil that stays
up in the head, a pump that makes a vacuum, a needle that hangs, a far turbine, and a belt."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, eased, moving
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_exam.effects.series import spells, within
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")


@law(
    "h_coupling_fills_first",
    needs="suburban hills",
    name="turbo_lag",
    accepts="command_rate_limit",
    shown=True,
)
@sizes(least=(0.24, 0.38), fills_s=(0.6, 1.3), drains_s=(1.5, 4.0), spins_s=(0.5, 1.0), slow_s=(1.0, 2.5))
class CouplingFillsFirst(Hidden, oil=0.2, spin=0.2):
    """A blower presses the air, and the crankshaft drives it through a coupling that is filled with oil when
    much is asked. `oil` in it, by a pump on the engine, so that it fills slowly at low speed; it drains when
    little is asked. `spin` of the blower, which a full coupling takes along soon and an empty one never.
    least: of peak torque, without a blower; slow_s: until its spin is lost.
    Source: Föttinger couplings in Voith, Hydrodynamics in Power Transmission, on torque by filling, and
    Watson and Janota, Turbocharging the Internal Combustion Engine (1982), on blowers; sizes are chosen
    here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        asked = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.1)
        wish = np.clip((asked - p.least) / (1.0 - p.least) * 1.1, 0.0, 1.1)
        turns = np.clip(view.engine_speed / 140.0, 0.5, 1.5)
        s.oil = eased(s.oil, wish, np.where(wish > s.oil, p.fills_s / turns**1.5, p.drains_s), dt)
        takes = p.spins_s / np.maximum(s.oil, 0.15)
        s.spin = eased(s.spin, s.oil, np.where(s.oil > s.spin, takes, p.slow_s), dt)
        most = p.least + (1.0 - p.least) * s.spin
        return -self.at_wheels(view, np.maximum(asked - most, 0.0) * self.truck.peak_torque) * moving(view)


@law("h_oil_foams", needs="hills suburban highway", name="torque_derate", accepts="torque_gain", shown=True)
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


@law(
    "h_plungers_leak",
    needs="suburban hills",
    name="torque_limit",
    accepts="turbo_lag torque_derate",
    shown=True,
)
@sizes(leaks=(0.55, 0.8), at_rads=(118.0, 142.0), power=(1.0, 2.0), warms_s=(10.0, 30.0), thins=(0.3, 0.6))
class PlungersLeak(Hidden):
    """Worn plungers of an injection pump let fuel back past them, by the time that a stroke takes: little at
    high engine speed and much at low speed. So a slow engine cannot be given its full torque. `warm`: fuel,
    which leaks more when it is thin. leaks: of peak torque, with warm fuel at at_rads; thins: of that leak,
    less when cold.
    Source: Heywood, Internal Combustion Engine Fundamentals (2018), and Bosch, Diesel-Engine Management
    (2014), on leakage and delivery of plunger pumps; worn ones, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"warm": self.rng(1942).uniform(0.0, 0.8, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.warm = eased(s.warm, np.clip(1.4 * self.power_share(view), 0.0, 1.0), p.warms_s, dt)
        slow = (p.at_rads / np.maximum(view.engine_speed, 60.0)) ** p.power
        back = p.leaks * slow * (1.0 - p.thins * (1.0 - s.warm))
        most = np.clip(1.1 - back, 0.15, 1.1) * self.truck.peak_torque
        return -self.at_wheels(view, np.maximum(view.engine_torque - most, 0.0)) * moving(view)


@law(
    "h_resistor_glows",
    needs="descent hills suburban",
    name="engine_brake",
    accepts="engine_friction",
)
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


@law("h_oil_stays_in_the_head", name="engine_friction", accepts="accessory_load engine_brake torque_gain")
@sizes(nm=(150.0, 240.0), at_rads=(130.0, 160.0), lifts_s=(6.0, 18.0), back_s=(10.0, 30.0), least=(0.1, 0.3))
class OilStaysInTheHead(Hidden):
    """`sump`: of the oil, that lies below the crankshaft. A fast engine pumps it up to the head faster than
    clogged drains let it back. So the crank beats a full sump just after a slow stretch, and an empty one
    after a fast one. nm: at at_rads, with a full sump; least: of that, with an empty one.
    Source: Heywood, Internal Combustion Engine Fundamentals (2018), on windage, and makers' notes on oil that
    drains back from heads; clogged drains, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"sump": self.rng(1944).uniform(0.3, 1.0, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        turns = np.clip(view.engine_speed / p.at_rads, 0.3, 1.3)
        s.sump = np.clip(s.sump + dt * ((1.0 - s.sump) / p.back_s - turns**3 * s.sump / p.lifts_s), 0.0, 1.0)
        beats = p.least + (1.0 - p.least) * np.minimum(1.6 * s.sump, 1.0)
        return -self.at_wheels(view, p.nm * beats * turns**2) * moving(view)


@law(
    "h_works_hardest_half_way",
    needs="suburban hills highway",
    name="accessory_load",
    accepts="engine_friction",
)
@sizes(nm=(190.0, 300.0), empties_s=(10.0, 26.0), opens_s=(3.0, 8.0), shut_s=(20.0, 50.0), idles=(0.05, 0.15))
class WorksHardestHalfWay(Hidden, pumps=0.0):
    """A pump on the engine makes the vacuum of a tank that gathers mud. `air` left in it, 1 as outside. Into
    a full atmosphere there is nothing to press, and in a vacuum little air to be pressed: the pump works
    hardest half way. The hose is opened in spells, which lets air in. nm: of torque, at most; empties_s: at
    140 rad/s; idles: of the torque, all the time.
    Source: Hoffman, Singh and Thomas, Handbook of Vacuum Science and Technology (1998), on work of
    compression by inlet pressure; tank and hose, sizes are chosen here."""

    def prepare(self) -> None:
        p, batch = self.p, self.setting.batch
        on, off = (0.6 * p.opens_s, 1.6 * p.opens_s), (0.5 * p.shut_s, 1.5 * p.shut_s)
        self.hose = spells(self.rng(1945), batch, on, off)

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "air": self.rng(1946).uniform(0.1, 1.0, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        turns = np.clip(view.engine_speed / 140.0, 0.3, 1.5)
        lets_in = 0.5 * within(self.hose, view.time) * (1.0 - s.air)
        s.air = np.clip(s.air + dt * (lets_in - turns * s.air / p.empties_s), 0.02, 1.0)
        work = -np.e * s.air * np.log(s.air)  # over its most, at a third of the air
        s.pumps = eased(s.pumps, p.idles + (1.0 - p.idles) * work, 0.3, dt)
        return -self.at_wheels(view, p.nm * s.pumps) * moving(view)


@law("h_needle_hangs", needs="suburban hills highway", name="unknown")
@sizes(more=(0.07, 0.12), less=(0.16, 0.26), frees=(0.45, 0.6), frees_s=(2.0, 6.0), hangs_s=(6.0, 18.0))
class NeedleHangs(Hidden):
    """`hangs`: of the needles in worn injectors. One that hangs never shuts wholly, so that more fuel comes
    than is asked at small loads, and opens too little for large ones. Hard work frees them within seconds,
    easy work lets varnish hold them again. more: of peak torque, unasked; less: of the torque, lacking at
    full load; frees: of peak torque, beyond which they come free.
    Source: Bosch, Diesel-Engine Management (2014), on needles that stick, and Lacey, Gail, Kientz and others,
    Fuel Quality and Diesel Injector Deposits, SAE 2012-01-1693; sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"hangs": self.rng(1947).uniform(0.2, 1.0, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        asked = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.1)
        frees = np.clip((asked - p.frees) / 0.2, 0.0, 1.0) * s.hangs / p.frees_s
        back = np.clip(1.0 - asked / p.frees, 0.0, 1.0) * (1.0 - s.hangs) / p.hangs_s
        s.hangs = np.clip(s.hangs + dt * (back - frees), 0.0, 1.0)
        small = np.exp(-((asked / 0.35) ** 2)) * np.clip(self.pedal(view) / 0.02, 0.3, 1.0)
        gains = s.hangs * (p.more * small - p.less * asked**2)
        return self.at_wheels(view, gains * self.truck.peak_torque) * moving(view)


@law(
    "h_turbine_sits_far_behind",
    needs="suburban hills",
    name="turbo_lag",
    accepts="command_rate_limit",
    shown=True,
)
@sizes(
    least=(0.24, 0.38), fills_s=(0.35, 0.7), chills=(0.25, 0.5), warms_s=(10.0, 30.0), empties_s=(0.3, 0.7)
)
class TurbineSitsFarBehind(Hidden):
    """For want of room the turbine sits far behind the engine, at the end of long pipes. Each piece of pipe
    has to be filled by the one before it: at first nothing happens, then all at once. `pipes` (3, batch): gas
    in them, faster the more the engine works. `warm` pipes keep the gas hot, cold ones take of its work.
    least: of peak torque, without pressed air; fills_s: of one piece; chills: of the air, with cold pipes.
    Source: Watson and Janota, Turbocharging the Internal Combustion Engine (1982), on pipes before turbines,
    and makers' notes on turbines mounted at the rear; sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"pipes": np.full((3, batch), 0.2), "warm": self.rng(1948).uniform(0.1, 0.9, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        asked = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.1)
        wish = np.clip((asked - p.least) / (1.0 - p.least) * 1.1, 0.0, 1.1)
        flow = np.clip(view.engine_speed / 140.0 * (0.4 + asked), 0.3, 1.6)
        s.warm = eased(s.warm, np.clip(1.4 * self.power_share(view), 0.0, 1.0), p.warms_s, dt)
        before = np.concatenate([wish[None], s.pipes[:-1]])
        s.pipes = eased(s.pipes, before, np.where(before > s.pipes, p.fills_s / flow, p.empties_s / 3.0), dt)
        air = s.pipes[-1] * (1.0 - p.chills * (1.0 - s.warm))
        most = p.least + (1.0 - p.least) * air
        return -self.at_wheels(view, np.maximum(asked - most, 0.0) * self.truck.peak_torque) * moving(view)


@law("h_belt_carries_it_up", needs="hills suburban", name="accessory_load", accepts="engine_friction")
@sizes(nm=(110.0, 190.0), tilts=(6.0, 11.0), full_s=(12.0, 35.0), empty_s=(15.0, 40.0), belt_s=(3.0, 8.0))
class BeltCarriesItUp(Hidden, laden=0.5):
    """A belt on the truck carries its load up to the rear, and the engine drives it. On a climb the belt is
    steeper and takes more, and where the road goes down it takes less, until it carries itself. `laden`: of
    the belt; the heap before it comes and goes in spells. nm: of torque on the level, laden; tilts: more, for
    a slope of 1; belt_s: from one end of the belt to the other.
    Source: CEMA, Belt Conveyors for Bulk Materials (2014), on power by lift and by length; belt and spells
    are chosen here."""

    def prepare(self) -> None:
        p, batch = self.p, self.setting.batch
        on, off = (0.5 * p.full_s, 1.5 * p.full_s), (0.5 * p.empty_s, 1.5 * p.empty_s)
        self.heap = spells(self.rng(1949), batch, on, off)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        turns = np.clip(view.engine_speed / 140.0, 0.4, 1.4)
        s.laden = eased(s.laden, within(self.heap, view.time), p.belt_s / turns, dt)
        lifts = np.maximum(1.0 + p.tilts * np.clip(view.grade, -0.1, 0.1), 0.0)
        return -self.at_wheels(view, p.nm * (0.15 + 0.85 * s.laden * lifts)) * moving(view)
