"""A stiff turbocharger, a retarder's heat, foam, a stuck thermostat, a hot condenser, gas in the air, and
a fan that is gone."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, moving
from deeptruck_exam.effects.places import OnRoad, smooth_stretches
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")


@law(
    "e_turbo_in_cold_oil", needs="suburban hills", name="turbo_lag", accepts="command_rate_limit", shown=True
)
@sizes(without=(0.15, 0.3), spools_s=(0.8, 1.6), stiff=(1.5, 4.0), warms_s=(60.0, 200.0), drags=(0.3, 0.7))
class TurboInColdOil(Hidden, spins=0.0):
    """`spins`: speed of the rotor, 1 at peak power; its square is the torque it allows. Oil in its bearings
    slows it, the more the colder. without: of peak torque, with none; stiff: times the warm oil, at first;
    drags: of the drive, warm.
    Source: Serrano, Olmeda, Tiseira, García-Cuevas and Lefebvre, Theoretical and Experimental Study of
    Mechanical Losses in Automotive Turbochargers, Energy 55 (2013); sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "cold": self.rng(1041).uniform(0.2, 1.0, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        asked = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.1)
        s.cold = s.cold - dt * s.cold * (0.4 + self.power_share(view)) / p.warms_s
        flow = np.clip(view.engine_speed / 150.0, 0.4, 1.4)
        boost = np.clip((asked - p.without) / (1.0 - p.without), 0.0, 1.1)
        goal = np.sqrt(boost)
        thick = 1.0 + p.drags * p.stiff * s.cold
        up = flow * (0.25 + goal) / (p.spools_s * thick)
        s.spins = s.spins + dt * np.where(goal > s.spins, up * np.minimum((goal - s.spins) / 0.15, 1.0), 0.0)
        s.spins = s.spins + dt * np.minimum(goal - s.spins, 0.0) * thick / (2.5 * p.spools_s)
        missing = np.maximum(asked - p.without - (1.0 - p.without) * s.spins**2, 0.0) * (asked > p.without)
        return -self.at_wheels(view, missing * self.truck.peak_torque) * moving(view)


@law("e_braking_heats_the_coolant", needs="hills", name="torque_derate", accepts="torque_gain", shown=True)
@sizes(depth=(0.35, 0.6), heats_s=(35.0, 80.0), brakes=(0.5, 1.0), cools_s=(90.0, 220.0), span=(0.15, 0.35))
class BrakingHeatsTheCoolant(Hidden):
    """`heat` of the coolant: 0 at the thermostat, 1 where torque begins to be cut. A retarder's share of
    every braking goes into it, and so does work. heats_s: of peak power, to 1; brakes: share of brake power.
    Source: Automotive Handbook (Bosch), on hydrodynamic retarders cooled by the engine's coolant, and SAE
    J1393, Heavy Duty Vehicle Cooling Test Code; a radiator that is half blocked, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"heat": self.rng(1042).uniform(0.2, 1.0, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        brakes = np.clip(view.brake_force * speed / self.truck.peak_power, 0.0, 2.0)
        wind = 0.6 + 0.4 * np.clip(speed / 15.0, 0.0, 1.6)
        gains = 0.1 + self.power_share(view) + p.brakes * brakes
        s.heat = np.clip(s.heat + dt * (gains / p.heats_s - wind * s.heat / p.cools_s), 0.0, 2.0)
        cut = p.depth * np.clip((s.heat - 1.0) / p.span, 0.0, 1.0)
        return -self.at_wheels(view, cut * np.maximum(view.engine_torque, 0.0))


@law("e_foam_in_the_slave_pistons", needs="descent hills", name="engine_brake", accepts="engine_friction")
@sizes(share=(0.45, 0.8), waits_s=(0.4, 1.5), foams_s=(10.0, 30.0), left=(0.3, 0.6), from_rads=(100.0, 118.0))
class FoamInTheSlavePistons(Hidden, shut=0.0, on=0.0, foam=0.0):
    """A switch that was left on: the engine brake follows the pedal. Its oil takes up air the faster the
    engine turns, and lifts the valves less and less until it has rested. share: of its torque at 200 rad/s;
    left: of that, all foam.
    Source: Nikolajsen, Viscosity and Density Models for Aerated Oil in Fluid-Film Bearings, Tribology Trans.
    42 (1999), on air in oil, and Cummins, US patent 3 220 392 (1965), on slave pistons moved by oil; times
    are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        turns = view.engine_speed
        s.shut = np.where(self.pedal(view) < 0.02, s.shut + dt, 0.0)
        wants = (s.shut > p.waits_s) * np.clip((turns - p.from_rads) / 8.0, 0.0, 1.0)
        s.on = s.on + dt * (wants - s.on) / np.where(wants > s.on, 0.4, 0.15)
        gains = s.on * (turns / 160.0) ** 2 * (1.0 - s.foam) / p.foams_s
        s.foam = np.clip(s.foam + dt * (gains - (1.0 - s.on) * s.foam / 40.0), 0.0, 1.0)
        lifts = 1.0 - (1.0 - p.left) * s.foam
        torque = p.share * self.truck.engine_brake_torque * np.clip(turns / 200.0, 0.0, 1.2) * lifts
        return -self.at_wheels(view, torque * s.on) * moving(view)


@law("e_thermostat_is_open", name="engine_friction", accepts="engine_brake accessory_load")
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


@law(
    "e_condenser_lacks_wind", needs="hills highway suburban", name="accessory_load", accepts="engine_friction"
)
@sizes(nm=(60.0, 110.0), head=(0.6, 1.4), heats_s=(8.0, 25.0), on_s=(25.0, 60.0), off_s=(10.0, 30.0))
class CondenserLacksWind(Hidden, on=1.0, runs=0.0):
    """`head`: pressure behind the compressor, which the wind of driving lowers; it trips above a limit until
    it has cooled. Cabins or cargo call for it by a thermostat. nm: with much wind; head: more without.
    Source: Kiss, Chaney and Meyer, A New Automotive Air Conditioning System Simulation Tool Developed in
    MATLAB/Simulink, SAE 2013-01-0850, and the ASHRAE Handbook on condensers; a coach's system on a truck,
    sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        rng = self.rng(1045)
        begin = {"room": rng.uniform(0.0, 1.0, batch), "head": rng.uniform(0.2, 0.9, batch)}
        return {**super().start(batch), **begin, "tripped": np.zeros(batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.on = np.where(s.room >= 1.0, 1.0, np.where(s.room <= 0.0, 0.0, s.on))
        s.tripped = np.where(s.head > 1.15, 1.0, np.where(s.head < 0.5, 0.0, s.tripped))
        works = s.on * (1.0 - s.tripped)
        s.runs = s.runs + dt * (works - s.runs) / 0.4
        s.room = np.clip(s.room + dt * np.where(works > 0.0, -1.0 / p.on_s, 1.0 / p.off_s), 0.0, 1.0)
        lacks = 1.3 / (1.0 + (np.maximum(view.speed, 0.0) / 9.0) ** 1.5)
        s.head = s.head + dt * (lacks * works - s.head) / p.heats_s
        return -self.at_wheels(view, p.nm * (1.0 + p.head * s.head) * s.runs) * moving(view)


@law("e_gas_in_the_air", needs="highway suburban hills", name="unknown")
@sizes(most=(0.10, 0.22), apart_m=(250.0, 900.0), clears_s=(1.0, 4.0))
class GasInTheAir(OnRoad, inside=0.0):
    """Near leaking wells and works the engine draws in gas and burns it beside what is asked, whatever the
    pedal says. most: of peak torque, in the thickest.
    Source: U.S. Chemical Safety Board, Investigation Report 2005-04-I-TX, Refinery Explosion and Fire (2007),
    and 30 CFR 36 on air shut-off: diesels run away on gas in their intake; thin clouds, sizes are chosen
    here."""

    def prepare(self) -> None:
        gaps = (0.5 * self.p.apart_m, 1.5 * self.p.apart_m)
        self.road = smooth_stretches(self.rng(1046), self.rows(), gaps, (150.0, 500.0))

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.inside = s.inside + dt * (self.read(self.road, view) - s.inside) / p.clears_s
        torque = p.most * self.truck.peak_torque * s.inside
        return self.at_wheels(view, torque) * np.clip(view.speed / 3.0, 0.0, 1.0)


@law("e_fan_that_is_gone", needs="highway suburban hills", name="unknown")
@sizes(nm=(130.0, 240.0), warms_s=(15.0, 40.0), cools_s=(20.0, 60.0), below=(0.3, 0.6))
class FanThatIsGone(Hidden, on=0.0, adds=0.0):
    """The control unit adds what its big fan would take whenever that is called for, and there is none. nm:
    at 180 rad/s; below: of the heat at which it is called, where it is sent away.
    Source: SAE J1939-71, SPN 2978, Estimated Engine Parasitic Losses, on torque that is fed forward, and SAE
    J1342 on fans with the square of speed; one that was taken off, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "heat": self.rng(1047).uniform(0.2, 1.1, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        cooling = (0.5 + 0.5 * np.clip(view.speed / 18.0, 0.0, 1.4)) / p.cools_s
        s.heat = np.clip(
            s.heat + dt * (3.0 * self.power_share(view) / p.warms_s - cooling * s.heat), 0.0, 1.5
        )
        s.on = np.where(s.heat > 1.0, 1.0, np.where(s.heat < p.below, 0.0, s.on))
        s.adds = s.adds + dt * (s.on - s.adds) / 1.5
        torque = p.nm * (view.engine_speed / 180.0) ** 2 * s.adds * (self.pedal(view) > 0.02)
        return self.at_wheels(view, torque) * np.clip(view.speed / 2.0, 0.0, 1.0)
