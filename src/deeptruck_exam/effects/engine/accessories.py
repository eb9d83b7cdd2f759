"""What the engine drives beside the truck: fans, compressors, generators, pumps."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, eased, moving
from deeptruck_exam.effects.places import Bends, OnRoad, sections, windows
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_exam.effects.series import spells, within
from deeptruck_model.trucks import View

law = partial(hidden, name="accessory_load", accepts="engine_friction")


@law("accessory_load", "first", "hills highway suburban")
@sizes(fan_w=(18000.0, 38000.0), compressor_w=(2500.0, 5000.0), heat_s=(15.0, 45.0))
class ThermostatFan(Hidden):
    """fan_w at 170 rad/s engine speed.
    Source: Fan by the affinity laws (power with speed cubed) through an on/off clutch with thermostat
    hysteresis; compressor in load and unload cycles; powers of a heavy truck, chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        rng = self.rng(7)
        return {
            "heat": rng.uniform(0.0, 1.0, batch),
            "on": np.zeros(batch),
            "tank": rng.uniform(0.7, 1.0, batch),
            "pumping": np.zeros(batch),
        }

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        load = np.maximum(view.engine_torque, 0.0) * view.engine_speed / self.truck.peak_power
        s.heat += dt * (0.25 + 1.2 * load - 1.1 * s.on) / p.heat_s
        s.heat = np.clip(s.heat, 0.0, 1.2)
        s.on = np.where(s.heat > 1.0, 1.0, np.where(s.heat < 0.35, 0.0, s.on))
        s.tank -= dt * (0.004 + 0.03 * np.clip(view.brake_force / 2e4, 0.0, 1.0) - 0.02 * s.pumping)
        s.pumping = np.where(s.tank < 0.75, 1.0, np.where(s.tank > 0.95, 0.0, s.pumping))
        w = np.maximum(view.engine_speed, 40.0)
        torque = s.on * p.fan_w * w**2 / 170.0**3 + s.pumping * p.compressor_w / w
        return -self.at_wheels(view, torque) * moving(view)


@law("cooling_compressor", "second", "hills highway suburban")
@sizes(torque_nm=(130.0, 300.0), on_s=(25.0, 70.0), off_s=(20.0, 60.0), surge=(0.2, 0.6))
class CoolingCompressor(Hidden, torque=0.0):
    """Works in its own rhythm, whatever the truck does.
    Source: Transport refrigeration or a vacuum pump of fixed displacement on the engine: torque does not
    depend on speed, and running is timed by the load's own heat; duty, surge and sizes are chosen here."""

    def prepare(self) -> None:
        rng, batch = self.rng(141), self.setting.batch
        self.first = rng.uniform(0.0, self.p.on_s + self.p.off_s, batch)
        self.pace = rng.uniform(0.85, 1.2, batch)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        within = (self.first + self.pace * view.time) % (p.on_s + p.off_s)
        surge = 1.0 + p.surge * np.exp(-within / 3.0)
        wanted = np.where(within < p.on_s, p.torque_nm * surge, 0.0)
        s.torque += dt * (wanted - s.torque) / 0.7
        return -self.at_wheels(view, s.torque) * moving(view)


@law("viscous_fan", "fourth", "hills highway suburban")
@sizes(fan_nm=(260.0, 430.0), pumps_s=(25.0, 60.0), heats_s=(25.0, 60.0), engages=(0.30, 0.42))
class ViscousFan(Hidden):
    """fan_nm: locked at 1700 rpm; pumps_s at 1000 rpm.
    Source: Viscous fan clutches (suppliers' service literature): after standing the coupling is full of fluid
    and the fan locks until it has been pumped out, the faster the engine turns; later it engages by the air's
    heat with hysteresis; torque with fan speed squared; sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {
            "fluid": self.rng(350).uniform(0.5, 1.0, batch),
            "heat": np.full(batch, 0.25),
            "valve": np.zeros(batch),
        }

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        watts = np.maximum(view.engine_torque, 0.0) * view.engine_speed / self.truck.peak_power
        ram = 0.2 * np.clip(view.speed / 20.0, 0.0, 1.3)
        s.heat += dt * (0.25 + np.minimum(watts, 1.0) - ram - 0.25 * s.fluid - s.heat) / p.heats_s
        s.valve = np.where(s.heat > p.engages, 1.0, np.where(s.heat < p.engages - 0.12, 0.0, s.valve))
        pumps = view.engine_speed / 104.7 / p.pumps_s
        s.fluid += dt * np.where(s.valve > 0.0, (1.0 - s.fluid) / 4.0, -pumps * (s.fluid - 0.08))
        slips = s.fluid**0.7 * view.engine_speed / 178.0
        return -self.at_wheels(view, p.fan_nm * slips**2) * moving(view)


@law("charges_in_overrun", "fifth", "hills highway suburban", accepts="engine_friction engine_brake")
@sizes(power_w=(16000.0, 32000.0), steady=(0.35, 0.7), energy_j=(0.3e6, 1.2e6), uses=(0.2, 0.4))
class ChargesInOverrun(Hidden):
    """uses: of the power, all the time; below a third of the buffer it charges under load too.
    Source: Large generators for electric refrigeration and buffers charge hard while the truck coasts, not at
    all under load, and steadily where the buffer is low (intelligent alternator control: Automotive Handbook,
    Bosch, on energy management); torque is power over speed; sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {
            "buffer": self.rng(453).uniform(0.2, 0.7, batch),
            "must": np.zeros(batch),
            "torque": np.zeros(batch),
        }

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.must = np.where(s.buffer < 0.33, 1.0, np.where(s.buffer > 0.6, 0.0, s.must))
        coasts = view.engine_torque < 0.0
        share = np.where(coasts, s.buffer < 0.97, p.steady * s.must)
        most = 1.3 * p.power_w / 105.0  # N m, the belt's
        wanted = np.minimum(share * p.power_w / np.maximum(view.engine_speed, 60.0), most)
        s.torque += dt * (wanted - s.torque) / 0.3
        gained = s.torque * view.engine_speed - p.uses * p.power_w
        s.buffer = np.clip(s.buffer + dt * gained / p.energy_j, 0.0, 1.0)
        return -self.at_wheels(view, s.torque) * moving(view)


@law("pumps_after_braking", "sixth", "hills highway suburban")
@sizes(torque_nm=(90.0, 190.0), uses=(1.2, 3.5), leaks_s=(40.0, 110.0), fills_s=(12.0, 32.0))
class PumpsAfterBraking(Hidden):
    """air: 0 at cut-in, 1 at cut-out. uses: of the difference between cut-in and cut-out, by one full
    application; fills_s: at 130 rad/s.
    Source: Compressors run from cut-in to cut-out, as long as brakes, air springs and leaks have used (FMVSS
    121 S5.1 on build-up; Automotive Handbook, Bosch, on air supply): after every hard use, and longer at low
    engine speed; large compressors of a train with a burst bellows, sizes are chosen here."""

    def prepare(self) -> None:
        self.first = self.rng(514).uniform(0.0, 1.0, self.setting.batch)

    def start(self, batch: int) -> dict[str, Array]:
        zero = np.zeros(batch)
        return {"air": self.first.copy(), "on": (self.first < 0.5).astype(float), "was": zero}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        asked = view.brake_force / self.truck.brake_capacity
        used = p.uses * np.maximum(asked - s.was, 0.0) + dt / p.leaks_s
        s.was = asked
        s.on = np.where(s.air <= 0.0, 1.0, np.where(s.air >= 1.0, 0.0, s.on))
        pumped = dt * s.on * np.clip(view.engine_speed / 130.0, 0.4, 1.6) / p.fills_s
        s.air = np.clip(s.air + pumped - used, -1.0, 1.0)
        torque = p.torque_nm * (0.8 + 0.2 * s.air) * s.on
        return -self.at_wheels(view, torque) * moving(view)


@law("fan_clutch_on_and_off", "seventh", "hills highway suburban")
@sizes(torque_nm=(190.0, 330.0), on=(0.16, 0.34), off=(0.4, 0.75), warms_s=(12.0, 35.0))
class FanClutchOnAndOff(Hidden):
    """The fan itself cools, and so does the wind of driving. torque_nm: at 200 rad/s; on: coolant, as the
    mean of power over the most; off: of that.
    Source: SAE J1342, Test Methods for Determining Power Consumption of Engine Cooling Fan-Drive Systems: a
    fan behind a clutch that is on or off takes torque with speed squared; on by coolant, off well below, and
    for the air conditioning's pressure; a large fan."""

    def prepare(self) -> None:
        rng = self.rng(702)
        self.cools_cab = spells(rng, self.setting.batch, (8.0, 16.0), (25.0, 70.0))

    def start(self, batch: int) -> dict[str, Array]:
        zero = np.zeros(batch)
        return {"coolant": zero + 0.8 * self.p.on, "on": zero, "grips": zero.copy()}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        power = np.maximum(view.engine_torque, 0.0) * view.engine_speed / self.truck.peak_power
        wind = 1.0 + 0.3 * np.clip(view.speed / 20.0, 0.0, 1.3) + 0.9 * s.on
        s.coolant += dt * (1.3 * power - wind * s.coolant) / p.warms_s
        s.on = np.where(s.coolant > p.on, 1.0, np.where(s.coolant < p.off * p.on, 0.0, s.on))
        wanted = np.maximum(s.on, within(self.cools_cab, view.time))
        s.grips += dt * (wanted - s.grips) / 0.8
        torque = p.torque_nm * s.grips * (view.engine_speed / 200.0) ** 2
        return -self.at_wheels(view, torque) * moving(view)


@law("s_steering_pump", "eighth", "highway suburban hills")
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


@law("x_heats_its_catalyst", "thirteenth", "suburban descent hills")
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


@law("k_inflates_its_tyres", "fourteenth", "hills highway suburban")
@sizes(kw=(18.0, 34.0), fills_s=(40.0, 120.0), lets_s=(8.0, 25.0), mean_m=(250.0, 800.0), soft=(0.35, 0.55))
@sizes(loads_s=(0.4, 1.2))
class InflatesItsTyres(OnRoad, works=0.0, load=0.0):
    """`full`: air in the tyres. On soft stretches it is let out, and behind them a compressor fills them
    again, which takes minutes. kw: of its shaft, for a 20 t truck; soft: of the road.
    Source: makers' manuals of central tyre inflation for logging trucks, and FPInnovations (FERIC) reports on
    its use, on times of inflation; places and sizes are chosen here."""

    def prepare(self) -> None:
        self.road = windows(self.rng(1444), self.rows(), self.p.mean_m, self.p.soft)

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "full": self.rng(1445).uniform(0.0, 0.9, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        soft = self.between(self.road, view) > 0.5
        pumps = np.clip(view.engine_speed / 130.0, 0.4, 1.4) * s.load / p.fills_s
        s.full = np.clip(s.full + dt * np.where(soft, -s.full / p.lets_s, pumps), 0.0, 1.0)
        s.works = np.where(soft | (s.full > 0.98), 0.0, np.where(s.full < 0.85, 1.0, s.works))
        s.load = eased(s.load, s.works, p.loads_s, dt)
        size = np.clip(view.mass / 20000.0, 0.4, 1.4)
        watts = 1000.0 * p.kw * size * s.load * (0.7 + 0.3 * s.full)
        torque = np.minimum(watts / np.maximum(view.engine_speed, 70.0), 260.0)
        return -self.at_wheels(view, torque) * moving(view)


@law("q_leak_keeps_it_pumping", "fifteenth", "suburban hills highway")
@sizes(kw=(16.0, 28.0), leaks_s=(15.0, 45.0), fills_s=(10.0, 25.0), draws=(0.5, 1.2), loads_s=(0.3, 0.8))
class LeakKeepsItPumping(Hidden, works=0.0, load=0.0):
    """`air` in the tanks of a leaking train, 0 where the governor lets the compressor pump and 1 where it
    idles again. It pumps time after time, sooner after braking and for longer when the engine turns slowly,
    and against more and more pressure. kw: of its shaft, for a 20 t truck; draws: of the air, by a second of
    full braking.
    Source: Bendix, Tu-Flo compressor service data sheets and air brake handbook, on governors, leakage and
    duty cycles; a large compressor, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "air": self.rng(1543).uniform(0.1, 1.0, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        pumps = s.load * np.clip(view.engine_speed / 120.0, 0.4, 1.5) / p.fills_s
        braking = p.draws * view.brake_force / self.truck.brake_capacity
        s.air = np.clip(s.air + dt * (pumps - 1.0 / p.leaks_s * (1.0 - s.works) - 0.3 * braking), -0.5, 1.0)
        s.works = np.where(s.air <= 0.0, 1.0, np.where(s.air > 0.99, 0.0, s.works))
        s.load = eased(s.load, s.works, p.loads_s, dt)
        size = np.clip(view.mass / 20000.0, 0.4, 1.5)
        watts = 1000.0 * p.kw * size * s.load * (0.75 + 0.25 * s.air)
        torque = np.minimum(watts / np.maximum(view.engine_speed, 70.0), 280.0)
        return -self.at_wheels(view, torque) * moving(view)


@law("y_springs_breathe", "eighteenth", "suburban hills highway")
@sizes(
    nm=(150.0, 240.0), empties_m=(250.0, 700.0), fills_s=(8.0, 20.0), low=(0.5, 0.7), mean_m=(150.0, 600.0)
)
@sizes(idles=(0.05, 0.15))
class SpringsBreathe(OnRoad, works=0.0, pumps=0.0):
    """Valves at air springs let air out and in at each bump, so a rough road empties the `tank`. A compressor
    fills it by the engine's turns, from low until it is full, and needs more torque the fuller it is. On
    smooth roads it rests. nm: of torque, against a full tank; empties_m: of the roughest road; low: of the
    tank; idles: of the torque, at rest.
    Source: Wabco, manuals of air suspension with levelling valves, and Hanlon, Compressor Handbook (2001), on
    work by pressure; large valves, sizes are chosen here."""

    def prepare(self) -> None:
        rng = self.rng(1845)
        number = sections(rng, self.rows(), self.p.mean_m)
        rough = rng.uniform(0.05, 1.0, (self.rows(), int(number.max()) + 1))
        self.road = np.take_along_axis(rough, number, axis=1)

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "tank": self.rng(1846).uniform(0.55, 1.0, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        takes = self.read(self.road, view) * np.maximum(view.speed, 0.0) / p.empties_m
        turns = np.clip(view.engine_speed / 140.0, 0.3, 1.5)
        s.works = np.where(s.tank > 0.99, 0.0, np.where(s.tank < p.low, 1.0, s.works))
        s.tank = np.clip(s.tank + dt * (s.works * turns / p.fills_s - takes), 0.2, 1.0)
        s.pumps = eased(s.pumps, s.works, 0.4, dt)
        torque = p.nm * (p.idles + (1.0 - p.idles) * s.pumps * (0.4 + 0.6 * s.tank))
        return -self.at_wheels(view, torque) * moving(view)
