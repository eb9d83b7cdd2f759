"""Friction of the engine that the simulator does not know."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import GRAVITY, Array, Hidden, Sizes, State, eased, moving
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_exam.effects.series import spells, within
from deeptruck_model.trucks import View

law = partial(hidden, name="engine_friction", accepts="engine_brake accessory_load")


@law("engine_friction", "first")
@sizes(cold_c=(-20.0, 10.0), exponent=(0.25, 0.40), warm_s=(150.0, 500.0))
class ColdOil(Hidden):
    """Source: Shayler, Leong and Murphy, SAE 2005-01-1654: motoring friction rises with a power of oil
    viscosity, here by Vogel's equation, in a cold start; exponent range and warm-up are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"oil": self.p.cold_c + self.rng(6).uniform(0.0, 25.0, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        t = self.truck
        ratio = np.exp(1040.0 / (s.oil + 122.0) - 1040.0 / (95.0 + 122.0))  # Vogel, 15W-40
        w = np.maximum(view.engine_speed, 40.0)
        hot = t.friction_constant + t.friction_linear * w + t.friction_quadratic * w * w
        load = 0.35 + np.maximum(view.engine_torque, 0.0) / self.truck.peak_torque
        s.oil += dt * (95.0 - s.oil) * load / p.warm_s
        return -self.at_wheels(view, 0.55 * hot * (ratio**p.exponent - 1.0)) * moving(view)


@law("thin_oil", "third")
@sizes(rubbing_nm=(220.0, 450.0), cold=(0.2, 0.5), fades_rads=(60.0, 120.0), heats_s=(50.0, 140.0))
class ThinOil(Hidden):
    """Worst at low engine speed after a hard pull. rubbing_nm: at idle with hot oil.
    Source: Stribeck (1902) and Stachowiak and Batchelor, Engineering Tribology (2013): mixed friction grows
    as oil thins with heat and falls with sliding speed; worn bearings of a heavy diesel, sizes chosen
    here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"heat": self.rng(211).uniform(0.0, 0.5, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.heat += dt * (np.minimum(1.6 * self.power_share(view), 1.0) - s.heat) / p.heats_s
        share = p.cold + (1.0 - p.cold) * s.heat
        mixed = np.exp(-np.maximum(view.engine_speed - 62.8, 0.0) / p.fades_rads)
        return -self.at_wheels(view, p.rubbing_nm * share * mixed) * moving(view)


@law("chen_and_flynn", "fourth")
@sizes(constant_nm=(20.0, 60.0), peak_nm=(50.0, 130.0), speed_nm=(25.0, 80.0), boost=(0.2, 0.6))
class ChenAndFlynn(Hidden, pressure=0.3):
    """peak_nm at full load, speed_nm at 1500 rpm; peak pressure follows the load as boost builds up.
    Source: Chen and Flynn, Development of a Single Cylinder Compression Ignition Research Engine, SAE 650733:
    friction as a constant, the peak cylinder pressure, and piston speed with its square; several times a
    sound engine's, as after a liner has scored; sizes chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        load = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.1)
        s.pressure += dt * (0.35 + 0.65 * load - s.pressure) / p.boost
        pace = view.engine_speed / 157.0
        torque = p.constant_nm + p.peak_nm * s.pressure + p.speed_nm * (0.6 * pace + 0.4 * pace**2)
        return -self.at_wheels(view, torque) * moving(view)


@law("kept_hot", "fourth", "suburban hills highway")
@sizes(torque_nm=(110.0, 240.0), on_c=(215.0, 250.0), off_c=(262.0, 300.0), heats_s=(12.0, 30.0))
class KeptHot(Hidden):
    """torque_nm: at 1340 rpm without load.
    Source: Thermal management of aftertreatment (Stanton, Systematic Development of Highly Efficient and
    Clean Engines to Meet Future Commercial Vehicle Greenhouse Gas Regulations, SAE 2013-01-2421): below a
    catalyst temperature turbine vanes or a flap close, and pumping work grows; on and off by a heat that
    follows the load; sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        gas = self.rng(342).uniform(180.0, 320.0, batch)
        return {"gas": gas, "on": (gas < self.p.on_c).astype(float), "shut": np.zeros(batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        load = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.0)
        s.gas += dt * (140.0 + 330.0 * np.sqrt(load) + 25.0 * s.on - s.gas) / p.heats_s
        s.on = np.where(s.gas < p.on_c, 1.0, np.where(s.gas > p.off_c, 0.0, s.on))
        s.shut += dt * (s.on - s.shut) / 0.8
        torque = p.torque_nm * s.shut * (view.engine_speed / 140.0) * (1.0 - 0.5 * load)
        return -self.at_wheels(view, torque) * moving(view)


@law("liner_runs_warm", "fifth")
@sizes(cold_nm=(120.0, 230.0), film=(0.25, 0.6), film_s=(3.0, 9.0), block_s=(180.0, 500.0))
@sizes(with_speed=(0.3, 0.7))
class LinerRunsWarm(Hidden):
    """More friction in coasting than under load, and at the beginning of a drive.
    Source: Piston friction on floating liners falls with the liner's temperature within seconds of a load
    (Livanos and Kyrtatos, Friction Model of a Marine Diesel Engine Piston Assembly, Tribology Int. 40, 2007),
    around a block that needs minutes; viscosity to the power 1/2; worn rings, sizes chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"block": self.rng(452).uniform(0.1, 0.8, batch), "film": np.full(batch, 0.2)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        load = np.clip(view.engine_torque * view.engine_speed / self.truck.peak_power, 0.0, 1.1)
        s.film += dt * (np.sqrt(load) - s.film) / p.film_s
        s.block += dt * (1.0 - s.block) * (0.3 + load) / p.block_s
        thin = np.exp(-1.1 * s.block) * (1.0 - p.film * s.film)
        turns = np.clip(view.engine_speed / 140.0, 0.3, 1.7)
        return -self.at_wheels(view, p.cold_nm * thin * turns**p.with_speed) * moving(view)


@law("overfilled_sump", "sixth")
@sizes(torque_nm=(130.0, 260.0), level=(0.45, 0.85), tilts=(4.0, 12.0), foams_s=(25.0, 80.0))
class OverfilledSump(Hidden, foam=0.0, tilt=0.0):
    """More drag uphill than downhill, and less after minutes at high speed. torque_nm: a full dip at 150
    rad/s.
    Source: Cranks that dip into an overfilled sump (workshop manuals on oil level; windage in Heywood,
    Internal Combustion Engine Fundamentals, ch. 13): torque with speed squared and with the depth, which
    slope and acceleration tilt towards the flywheel, while foam takes oil away; sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.tilt += dt * (view.grade + np.clip(view.acceleration, -3.0, 3.0) / GRAVITY - s.tilt) / 0.4
        dips = np.clip(p.level + p.tilts * s.tilt - 0.5 * s.foam, 0.0, 1.6)
        turns = np.clip(view.engine_speed / 150.0, 0.3, 1.6)
        s.foam += dt * (np.clip(dips * turns**3, 0.0, 1.0) - s.foam) / p.foams_s
        return -self.at_wheels(view, p.torque_nm * dips * turns**2) * moving(view)


@law("oil_pump_in_high_stage", "seventh")
@sizes(torque_nm=(110, 230), low=(0.1, 0.35), from_load=(0.14, 0.3), stays_s=(6.0, 25))
class OilPumpInHighStage(Hidden, left=0.0, stage=0.0):
    """A truck that coasts after a climb drags more than one that has coasted for long. torque_nm: of the high
    stage, relief open; low: of it, in the low stage.
    Source: Oil pumps in two stages on motored benches (Heywood, Internal Combustion Engine Fundamentals, ch.
    13, counts them and the jets under the pistons to friction): torque with speed up to the relief valve's
    opening, and the high stage stays on for a while after load; a sticking stage valve."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        load = view.engine_torque / self.truck.peak_torque
        s.left = np.where(load > p.from_load, p.stays_s, np.maximum(s.left - dt, 0.0))
        s.stage += dt * ((s.left > 0.0) - s.stage) / 0.8
        turns = np.minimum(view.engine_speed / 145.0, 1.0)
        torque = p.torque_nm * (p.low + (1.0 - p.low) * s.stage) * turns
        return -self.at_wheels(view, torque) * moving(view)


@law("s_gelled_oil", "eighth")
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


@law("n_pistons_are_tight", "ninth", accepts="accessory_load")
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


@law("e_thermostat_is_open", "eleventh")
@sizes(nm=(90.0, 180.0), works_s=(60.0, 160.0), winds_s=(70.0, 180.0), thick=(1.2, 2.2))
class ThermostatIsOpen(Hidden):
    """`warm`: 0 as the air, 1 as it should be. The wind of driving cools what work warms: oil is thick on
    long ways down and thin uphill. nm: at 150 rad/s, cold, beyond the warm friction; thick: a power.
    Source: Pang and Brace, Review of Engine Cooling Technologies for Modern Engines, Proc. IMechE D 218
    (2004), on overcooling at part load, and Sandoval and Heywood, An Improved Friction Model for
    Spark-Ignition Engines, SAE 2003-01-0725, on friction with viscosity; sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"warm": self.rng(1044).uniform(0.1, 0.8, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        wind = 0.2 + np.clip(view.speed / 20.0, 0.0, 1.4)
        gains = (0.12 + 1.8 * self.power_share(view)) / p.works_s
        s.warm = np.clip(s.warm + dt * (gains - wind * s.warm / p.winds_s), 0.0, 1.0)
        turns = np.sqrt(np.clip(view.engine_speed / 150.0, 0.3, 1.6))
        torque = p.nm * turns * (1.05 - s.warm) ** p.thick
        return -self.at_wheels(view, torque) * moving(view)


@law("x_fuel_is_in_the_oil", "thirteenth")
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


@law("q_oil_cooler_by_turns", "fifteenth", accepts="accessory_load torque_gain")
@sizes(
    nm=(50.0, 90.0),
    thick=(1.0, 1.8),
    warms_s=(12.0, 30.0),
    opens=(0.95, 1.1),
    shuts=(0.5, 0.65),
    bites=(0.9, 1.6),
)
class OilCoolerByTurns(Hidden, open=0.0, lets=0.0):
    """`warm`: the oil, whose cooler is opened by a thermostat that sticks: late, and then cold oil comes in a
    slug, until it shuts late again. So friction rises and falls by itself, faster under load. nm: of drag at
    150 rad/s with oil at 1; thick: more with each 1 it is colder; opens, shuts: of the oil's heat.
    Source: Heywood, Internal Combustion Engine Fundamentals (2018), on friction of bearings with viscosity
    of oil; a thermostat with a wide hysteresis, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "warm": self.rng(1542).uniform(0.3, 1.0, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        gains = 0.5 + 1.2 * np.clip(self.power_share(view), 0.0, 1.0)
        flow = np.clip(view.engine_speed / 130.0, 0.5, 1.4)
        s.open = np.where(s.warm > p.opens, 1.0, np.where(s.warm < p.shuts, 0.0, s.open))
        s.lets = eased(s.lets, s.open, 2.5, dt)
        cools = 0.15 + p.bites * s.lets * flow
        s.warm = np.clip(eased(s.warm, gains / cools, p.warms_s / cools, dt), 0.0, 1.4)
        torque = (
            p.nm * np.exp(p.thick * (1.0 - s.warm)) * np.sqrt(np.clip(view.engine_speed / 150.0, 0.2, 1.5))
        )
        return -self.at_wheels(view, torque) * moving(view)


@law("z_pump_presses_the_rail", "seventeenth", accepts="accessory_load torque_gain")
@sizes(nm=(160.0, 250.0), least=(0.05, 0.15), rises_s=(0.3, 0.8), falls_s=(2.0, 6.0), leaks_s=(15.0, 45.0))
class PumpPressesTheRail(Hidden, rail=0.3):
    """`rail`: pressure of the fuel, which a pump keeps up with the same torque at any speed. The pressure
    follows what is asked upwards at once. It comes down only by what is injected, so it stays high after a
    pull when nothing is burnt at all, and the pump goes on working. nm: of friction, at full pressure; least:
    of the pressure, at idle; falls_s, leaks_s: by injection at full load, and by leaks.
    Source: Bosch, Diesel Engine Management (2014), on common rails whose pressure falls by injection and
    leakage, and on torque of their pumps; a pump without metering, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        load = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.1)
        wish = p.least + (1.0 - p.least) * np.sqrt(load)
        down = 1.0 / (load / p.falls_s + 1.0 / p.leaks_s)
        s.rail = eased(s.rail, wish, np.where(wish > s.rail, p.rises_s, down), dt)
        return -self.at_wheels(view, p.nm * s.rail) * moving(view)


@law("y_film_heats_itself", "eighteenth", accepts="accessory_load engine_brake torque_gain")
@sizes(nm=(190.0, 300.0), at_rads=(130.0, 165.0), thins=(1.2, 2.0), heats_s=(3.0, 9.0), lasts=(0.3, 0.6))
class FilmHeatsItself(Hidden, film=0.2):
    """`film`: heat of oil in a tight bearing, over that of its housing. Shear heats it by the square of
    speed, and hot oil is thin. So friction is high just after the revs have risen, falls within seconds, and
    is low for a moment after they have sunk. nm: at at_rads, cold; thins: power of the heat; lasts: how
    friction rises with speed.
    Source: Cameron, Basic Lubrication Theory (1976), and Dowson, A Generalized Reynolds Equation for
    Fluid-Film Lubrication (1962), on films that heat themselves; a tight bearing, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        turns = np.clip(view.engine_speed / p.at_rads, 0.3, 1.5)
        thin = np.exp(-p.thins * s.film)
        s.film = eased(s.film, 1.2 * turns**2 * (0.4 + 0.6 * thin), p.heats_s, dt)
        return -self.at_wheels(view, p.nm * turns ** (1.0 + p.lasts) * thin) * moving(view)


@law("h_oil_stays_in_the_head", "nineteenth", accepts="accessory_load engine_brake torque_gain")
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


@law("b_cams_run_dry", "twentieth", accepts="accessory_load engine_brake torque_gain")
@sizes(nm=(190.0, 310.0), at_rads=(95.0, 125.0), power=(0.5, 1.0), wets_s=(4.0, 12.0), dries_s=(25.0, 70.0))
@sizes(wet=(0.5, 0.75))
class CamsRunDry(Hidden):
    """Cams and followers get their oil by what the crank throws up. `film` on them: made while the engine
    turns fast, and wiped off while it turns slowly. Dry cams rub the harder, the slower they turn. nm: dry,
    at at_rads; power: of the speed, by which it falls; wet: of it, less with a whole film.
    Source: Taylor (ed.), Engine Tribology (1993), on friction of cams and followers, and Heywood, Internal
    Combustion Engine Fundamentals (2018); worn cams, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"film": self.rng(2042).uniform(0.0, 0.9, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        turns = np.maximum(view.engine_speed, 50.0) / p.at_rads
        throws = np.clip(turns - 0.95, 0.0, 0.6) / 0.3 * (1.0 - s.film) / p.wets_s
        s.film = np.clip(s.film + dt * (throws - s.film / p.dries_s), 0.0, 1.0)
        rubs = np.minimum(turns**-p.power, 1.6) * (1.0 - p.wet * s.film)
        return -self.at_wheels(view, p.nm * rubs) * moving(view)
