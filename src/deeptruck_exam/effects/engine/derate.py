"""Torque that is taken back while something is too hot, too cold or too empty."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import GRAVITY, Array, Hidden, Sizes, State, eased, moving
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_exam.effects.series import some_drives, spells, within
from deeptruck_model.trucks import View

law = partial(hidden, name="torque_derate", accepts="torque_gain", shown=True)


@law("torque_derate", "first", "hills highway")
@sizes(depth=(0.20, 0.45), from_k=(6.0, 14.0), span_k=(6.0, 14.0), block_s=(60.0, 140.0))
class CoolantDerate(Hidden, block=0.0, coolant=0.0):
    """Temperatures in K above the thermostat.
    Source: Protection derate: a diesel cuts fuelling in proportion above a coolant temperature; coolant and
    block as two thermal masses with ram-air cooling; structure and numbers are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        load = np.maximum(view.engine_torque, 0.0) * view.engine_speed / self.truck.peak_power
        s.block += dt * (60.0 * load - (s.block - s.coolant)) / p.block_s * 2.0
        cooling = s.coolant * (0.4 + view.speed / 20.0)
        s.coolant += dt * ((s.block - s.coolant) - cooling) / 30.0
        cut = p.depth * np.clip((s.coolant - p.from_k) / p.span_k, 0.0, 1.0)
        return -self.at_wheels(view, cut * np.maximum(view.engine_torque, 0.0))


@law("staged_protection", "second", "hills suburban")
@sizes(step=(0.20, 0.38), limit=(0.17, 0.33), band=(0.12, 0.3), soak_s=(18.0, 45.0))
class StagedProtection(Hidden):
    """Charge-air heat: 1 for full power at walking pace.
    Source: Derates of engine protection come as a step, over a ramp, and stay until well below the limit;
    heat soak of the charge air in slow driving, steps and limits are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {
            "heat": self.rng(140).uniform(0.0, 0.3, batch),
            "on": np.zeros(batch),
            "cut": np.zeros(batch),
        }

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        power = np.maximum(view.engine_torque, 0.0) * view.engine_speed / self.truck.peak_power
        through = 1.0 + np.maximum(view.speed, 0.0) / 25.0  # ram air
        s.heat += dt * (1.4 * power / through - s.heat) / p.soak_s
        s.on = np.where(s.heat > p.limit, 1.0, np.where(s.heat < p.limit * (1.0 - p.band), 0.0, s.on))
        s.cut += np.clip(p.step * s.on - s.cut, -0.10 * dt, 0.10 * dt)
        return -self.at_wheels(view, s.cut * np.maximum(view.engine_torque, 0.0))


@law("inducement", "fourth", "hills highway")
@sizes(depth=(0.25, 0.45), per_s=(0.006, 0.02), share_of_drives=(0.5, 0.75))
class Inducement(Hidden):
    """A drive begins with the step that the last one ended with, or with none.
    Source: Inducement after a fault of the urea system (40 CFR 86.007-11; UN Regulation No. 49, annex 11:
    torque less by a quarter): comes during a drive, along a ramp, and stays until the key is turned; moments
    and ramps chosen here."""

    def prepare(self) -> None:
        rng, batch = self.rng(340), self.setting.batch
        drives = some_drives(rng, batch, self.p.share_of_drives)
        first = np.where(rng.random(batch) < 0.4, -1e3, rng.uniform(0.05, 0.55, batch))
        self.from_s = np.where(drives, first * self.setting.duration_s, np.inf)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        since = np.maximum(view.time - self.from_s, 0.0)
        cut = np.minimum(p.per_s * since, p.depth)
        return -self.at_wheels(view, cut * np.maximum(view.engine_torque, 0.0))


@law("hot_intake", "fourth", "suburban hills")
@sizes(soak_k=(80.0, 130.0), exponent=(1.2, 2.0), soaks_s=(20.0, 50.0), fresh_mps=(4.5, 9.0))
class HotIntake(Hidden):
    """Source: ISO 3046-1: power with a power of the intake temperature; an intake behind the cab breathes the
    engine's own heat while the truck stands or crawls and fresh air once it moves; heat and exponent are
    chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"hot": self.rng(341).uniform(0.0, 0.8, batch) * self.p.soak_k}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        watts = np.maximum(view.engine_torque, 0.0) * view.engine_speed / self.truck.peak_power
        recirculated = np.exp(-((np.maximum(view.speed, 0.0) / p.fresh_mps) ** 2))
        wanted = p.soak_k * (recirculated + 0.5 * np.minimum(watts, 1.0) * (0.3 + 0.7 * recirculated))
        s.hot += dt * (wanted - s.hot) / np.where(wanted > s.hot, p.soaks_s, 1.6 * p.soaks_s)
        left = (298.0 / (298.0 + s.hot)) ** p.exponent
        return -self.at_wheels(view, (1.0 - left) * np.maximum(view.engine_torque, 0.0))


@law("bank_trips", "sixth", "hills highway")
@sizes(share=(0.22, 0.40), early=(0.66, 0.82), warms_s=(10.0, 28.0), rests_s=(0.6, 2.5))
class BankTrips(Hidden):
    """Whoever lifts his foot has all cylinders again. early: 1 less the mean of power over the most that it
    bears.
    Source: Control units cut a bank of injectors whose driver or harness runs hot, and try again after the
    pedal has been closed (Diesel-Engine Management, Bosch, on monitoring and substitute functions); the trip
    as of a thermal cut-out, by the square of the load over time; sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        zero = np.zeros(batch)
        return {"heat": zero + 0.02, "out": zero.copy(), "rests": zero.copy()}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        torque = np.maximum(view.engine_torque, 0.0)
        power = np.clip(torque * view.engine_speed / self.truck.peak_power, 0.0, 1.2)
        s.heat += dt * (power**2 - s.heat) / p.warms_s
        trips = (1.0 - p.early) ** 2
        closed = (view.u[:, 0] < 0.02 * self.truck.full_command) & (view.shifting < 0.5)
        s.rests = np.where(closed, s.rests + dt, 0.0)
        again = s.rests > p.rests_s
        s.out = np.where(again, 0.0, np.where(s.heat > trips, 1.0, s.out))
        s.heat = np.where(again, np.minimum(s.heat, 0.5 * trips), s.heat)
        return -self.at_wheels(view, p.share * s.out * torque)


@law("turbine_inlet_kept_cool", "seventh", "hills highway")
@sizes(limit=(0.12, 0.26), metal_s=(5.0, 16.0), takes=(0.08, 0.2), most=(0.35, 0.55))
class TurbineInletKeptCool(Hidden, metal=0.15, cut=0.0):
    """Low engine speed is hotter for the same torque: less air for it. limit: of the rise at full torque;
    takes: share of torque a second, for each unit above.
    Source: Limits of exhaust temperature ahead of the turbine (Diesel-Engine Management, Bosch, on limitation
    of injected quantity): an integral control takes fuel while the metal is too hot and gives it back
    slowly."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        torque = np.maximum(view.engine_torque, 0.0)
        load = (1.0 - s.cut) * torque / self.truck.peak_torque
        gas = load * np.clip(130.0 / np.maximum(view.engine_speed, 60.0), 0.6, 1.5) ** 0.6
        s.metal += dt * (gas - s.metal) / p.metal_s
        over = s.metal - p.limit
        change = np.where(over > 0.0, p.takes * over / p.limit, -0.012)
        s.cut = np.clip(s.cut + dt * change, 0.0, p.most)
        return -self.at_wheels(view, s.cut * torque)


@law("n_level_switch_tilts", "ninth", "hills suburban")
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


@law("t_knock_takes_torque", "tenth", "hills highway")
@sizes(depth=(0.3, 0.5), bears=(0.32, 0.55), warms=(0.15, 0.4), retards_s=(3.0, 10.0), forgets_s=(20.0, 70.0))
class KnockTakesTorque(Hidden, warm=0.2, late=0.0):
    """`late`: of the ignition, 0..1; it goes back slowly where nothing knocks. bears: of peak torque without
    knock, cold; warms: less of it, hot.
    Source: Kiencke and Nielsen, Automotive Control Systems (2005), on knock control, which retards by steps
    and advances slowly; torque falls with the square of the delay; gas of a low methane number (EN 16726),
    sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        load = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.1)
        s.warm = s.warm + dt * (np.clip(1.3 * self.power_share(view), 0.0, 1.0) - s.warm) / 50.0
        knocks = np.clip((load - p.bears + p.warms * s.warm) / 0.15, 0.0, 1.0)
        rises = knocks * (1.0 - s.late) / p.retards_s
        s.late = np.clip(s.late + dt * (rises - (1.0 - knocks) * s.late / p.forgets_s), 0.0, 1.0)
        return -self.at_wheels(view, p.depth * s.late**2 * np.maximum(view.engine_torque, 0.0))


@law("e_braking_heats_the_coolant", "eleventh", "hills")
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


@law("v_battery_is_weak", "sixteenth", "suburban hills")
@sizes(
    most=(0.2, 0.34), cut_in_rads=(95.0, 115.0), holds_s=(5.0, 14.0), draws_s=(5.0, 14.0), lamps=(0.5, 0.8)
)
class BatteryIsWeak(Hidden):
    """`charge` of a worn battery, 1 full. Its generator gives little below cut_in_rads while lamps, heaters
    and blowers go on and off; then voltage sags, the injectors open late, and fuel is lost as by the square
    of what is missing. most: of the torque, lost with an empty one; holds_s: to fill; draws_s: to empty, with
    all that draws; lamps: of the rated current, on in the mean.
    Source: Bosch Automotive Handbook (2014), on generators' current with speed, on charge balance and on
    correction of injection times for voltage; a worn battery, sizes are chosen here."""

    def prepare(self) -> None:
        self.draws = spells(self.rng(1641), self.setting.batch, (10.0, 40.0), (8.0, 30.0))

    def start(self, batch: int) -> dict[str, Array]:
        return {"charge": self.rng(1642).uniform(0.2, 0.9, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        gives = np.clip((view.engine_speed - p.cut_in_rads) / 60.0, 0.0, 1.2)
        takes = p.lamps * (0.5 + 0.8 * within(self.draws, view.time))
        flow = np.where(gives > takes, (gives - takes) / p.holds_s, (gives - takes) / p.draws_s)
        s.charge = np.clip(s.charge + dt * flow, 0.0, 1.0)
        sags = np.clip((0.85 - s.charge) / 0.85, 0.0, 1.0)
        lost = p.most * (1.0 - (1.0 - sags) ** 2)
        return -self.at_wheels(view, lost * np.maximum(view.engine_torque, 0.0)) * moving(view)


@law("y_barometer_is_nearly_tight", "eighteenth", "hills suburban")
@sizes(most=(0.25, 0.42), climb_m=(3.0, 7.0), leaks_s=(30.0, 80.0), rests=(0.0, 0.1))
class BarometerIsNearlyTight(Hidden):
    """The engine gives less in thin air, by a barometer whose case should be open and is nearly tight. It
    reads the height climbed of late, and forgets that as its case leaks. `climbed` m. So a climb takes torque
    that comes back on the flat within a minute. most: of the torque, taken; climb_m: for two thirds of it;
    rests: always taken.
    Source: ISA standard atmosphere and SAE J1349 on corrections of power by pressure, and makers' manuals on
    variometers, which leak on purpose; a blocked vent and its sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"climbed": self.rng(1842).uniform(-0.5, 1.2, batch) * self.p.climb_m}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        rises = np.maximum(view.speed, 0.0) * view.grade
        s.climbed = np.clip(s.climbed + dt * (rises - s.climbed / p.leaks_s), -40.0, 40.0)
        thin = 1.0 - np.exp(-np.maximum(s.climbed, 0.0) / p.climb_m)
        taken = np.minimum(p.rests + p.most * thin, 0.7)
        return -self.at_wheels(view, taken * np.maximum(view.engine_torque, 0.0)) * moving(view)


@law("u_gearbox_asks_for_less", "twenty-first", "hills suburban highway", accepts="torque_gain torque_limit")
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
