"""What the engine drives beside the truck: fans, compressors, generators, pumps."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, moving
from deeptruck_exam.effects.places import Bends, OnRoad, smooth_stretches
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


@law("mixer_drum", "third", "hills highway suburban")
@sizes(power_w=(14000.0, 30000.0), stiffens=(0.1, 0.5), fast=(1.3, 1.8), each_s=(50.0, 90.0))
class MixerDrum(Hidden):
    """A light truck has a small drum.
    Source: Hydrostatic drive of a constant power, torque in inverse proportion to engine speed (Automotive
    Handbook, Bosch, on hydrostatic transmissions); a mixer drum whose concrete stiffens, with minutes of fast
    turning; powers and times chosen here."""

    def prepare(self) -> None:
        self.first = self.rng(212).uniform(0.0, 1.0, self.setting.batch)
        self.power = self.p.power_w * np.clip(self.truck.mass / 2.0e4, 0.5, 1.6)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        fast = (view.time / p.each_s + self.first) % 1.0 < 0.35
        stiff = 1.0 + p.stiffens * view.time / self.setting.duration_s
        watts = self.power * stiff * np.where(fast, p.fast, 1.0)
        torque = np.minimum(watts / np.maximum(view.engine_speed, 60.0), 0.10 * self.truck.peak_torque)
        return -self.at_wheels(view, torque) * moving(view)


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


@law("packs_on_the_go", "fourth", "suburban")
@sizes(torque_nm=(170.0, 330.0), stroke_s=(5.0, 11.0), strokes=(1.6, 3.4))
class PacksOnTheGo(Hidden, stood=0.0, since=1000.0):
    """Source: Refuse bodies that pack while the truck pulls away (body makers' manuals; NREL's refuse
    vocational duty cycles): a pump of fixed displacement works one stroke after every stop, pressure rising
    as the load is squeezed; pressures and times are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        stands = view.speed < 0.05
        s.since = np.where(stands & (s.stood > 1.0), 0.0, s.since + dt)
        s.stood = np.where(stands, s.stood + dt, 0.0)
        stroke = s.since / p.stroke_s
        works = np.floor(stroke) < np.round(p.strokes)
        most = np.minimum(p.torque_nm, 0.14 * self.truck.peak_torque)
        squeeze = 0.25 + 0.75 * (stroke - np.floor(stroke)) ** 2
        return -self.at_wheels(view, most * squeeze * works) * moving(view)


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


@law("blows_off_cement", "fifth", "hills highway suburban")
@sizes(torque_nm=(150.0, 300.0), creeps_s=(8.0, 25.0), left=(0.3, 0.6), on_share=(0.4, 0.7))
class BlowsOffCement(Hidden):
    """A saw tooth of torque, in parts of the drives.
    Source: Compressors and pumps on a clutch-independent power take-off that the driver leaves on between
    yards (bulk and vacuum tankers, body makers' manuals): a fixed displacement against a back pressure that
    creeps up and is blown off by a valve; sizes are chosen here."""

    def prepare(self) -> None:
        rng, batch = self.rng(454), self.setting.batch
        first = rng.uniform(0.0, 0.6, batch) * self.setting.duration_s
        self.from_s = np.where(rng.random(batch) < 0.5, 0.0, first)
        self.until_s = self.from_s + self.p.on_share * self.setting.duration_s

    def start(self, batch: int) -> dict[str, Array]:
        return {"pressure": np.full(batch, self.p.left)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        on = (self.from_s <= view.time) & (view.time < self.until_s)
        pumped = dt * np.clip(view.engine_speed / 130.0, 0.4, 1.6) / p.creeps_s
        s.pressure = np.where(s.pressure >= 1.0, p.left, np.minimum(s.pressure + pumped * on, 1.0))
        return -self.at_wheels(view, p.torque_nm * s.pressure * on) * moving(view)


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


@law("n_lift_drains_the_battery", "ninth", "suburban")
@sizes(power_wpkg=(1.0, 2.2), uses_s=(6.0, 20.0), charges_s=(25.0, 80.0), tapers=(0.2, 0.6))
class LiftDrainsTheBattery(Hidden):
    """`flat`: 1 for empty. Stands use it up, driving fills it, ever slower from `tapers` on.
    Source: Bucket trucks and lifts that work from a battery which the engine fills on the way (NREL field
    evaluations of hybrid utility trucks); constant power, then a taper, as chargers do; sizes are chosen
    here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"flat": self.rng(921).uniform(0.2, 0.9, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        share = np.clip(s.flat / p.tapers, 0.0, 1.0)
        change = np.where(view.speed < 0.1, 1.0 / p.uses_s, -share / p.charges_s)
        s.flat = np.clip(s.flat + dt * change, 0.0, 1.0)
        power = p.power_wpkg * view.mass * share
        torque = np.minimum(power / np.maximum(view.engine_speed, 60.0), 450.0)
        return -self.at_wheels(view, torque) * moving(view)


@law("t_box_is_kept_cold", "tenth", "hills highway suburban")
@sizes(nm=(90.0, 170.0), pulls_s=(18.0, 40.0), leaks_s=(35.0, 90.0), frosts_s=(60.0, 160.0))
class BoxIsKeptCold(Hidden, on=0.0, frost=0.0, thaws=0.0, runs=0.0):
    """`box`: 0 cold enough to 1 too warm. Doors warm it at stands; frost weakens the evaporator until it is
    thawed, when nothing runs.
    Source: ASHRAE Handbook, Refrigeration, on truck bodies, door openings and defrosting: a compressor on the
    engine, switched by a thermostat with a band, takes the more torque the warmer it is inside; sizes are
    chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        rng = self.rng(983)
        begin = {"box": rng.uniform(0.2, 1.3, batch), "frost": rng.uniform(0.0, 0.9, batch)}
        return {**super().start(batch), **begin}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.on = np.where(s.box >= 1.0, 1.0, np.where(s.box <= 0.0, 0.0, s.on))
        s.thaws = np.where(s.frost >= 1.0, 1.0, np.where(s.frost <= 0.0, 0.0, s.thaws))
        works = s.on * (1.0 - s.thaws)
        warms = 1.0 / p.leaks_s + 0.08 * (view.speed < 0.1)
        cools = works * (1.0 - 0.4 * s.frost) * (1.0 / p.pulls_s + 1.0 / p.leaks_s)
        s.box = np.clip(s.box + dt * (warms - cools), 0.0, 1.6)
        s.frost = np.clip(s.frost + dt * np.where(s.thaws > 0.0, -1.0 / 18.0, works / p.frosts_s), 0.0, 1.0)
        s.runs = s.runs + dt * (works - s.runs) / 0.5
        return -self.at_wheels(view, p.nm * (0.75 + 0.35 * s.box) * s.runs) * moving(view)


@law("e_condenser_lacks_wind", "eleventh", "hills highway suburban")
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


@law("w_sprays_by_the_metre", "twelfth", "highway suburban hills")
@sizes(kw=(35.0, 70.0), at_mps=(9.0, 14.0), opens_s=(0.5, 1.5), apart_m=(250.0, 800.0), idles=(0.1, 0.25))
class SpraysByTheMetre(OnRoad, sprays=0.0):
    """A sprayer gives each metre of the strips that are to be treated the same, so that its pump needs power
    with a power of speed, up to its relief valve. kw: of the pump, most; at_mps: where the valve opens;
    idles: of that, between.
    Source: Akesson and Yates, Pesticide Application Equipment and Techniques, FAO Agricultural Services
    Bulletin 38 (1979), on pressure with the square of ground speed at a constant rate; de-icing sprayers of
    airports, strips and sizes are chosen here."""

    def prepare(self) -> None:
        gaps = (0.4 * self.p.apart_m, 1.6 * self.p.apart_m)
        strips = smooth_stretches(self.rng(1144), self.rows(), gaps, (200.0, 900.0))
        self.road = np.where(strips > 0.15, 1.0, 0.0)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.sprays = s.sprays + dt * (self.read(self.road, view) - s.sprays) / p.opens_s
        rate = np.clip(view.speed / p.at_mps, 0.0, 1.0) ** 2.2
        watts = 1000.0 * p.kw * (p.idles + (1.0 - p.idles) * rate * s.sprays)
        torque = np.minimum(watts / np.maximum(view.engine_speed, 70.0), 450.0)
        return -self.at_wheels(view, torque) * moving(view)
