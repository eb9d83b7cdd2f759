"""Engine: accessories, engine brake, friction, derate, torque limits, turbo lag."""

from __future__ import annotations

import numpy as np

from deeptruck_core.arrays import Array
from deeptruck_exam.laws.catalogue import law, sizes
from deeptruck_exam.laws.law import Law, Sizes, State, moving
from deeptruck_model.trucks import View


@law("accessory_load", "hills highway suburban", accepts="engine_friction")
@sizes(fan_w=(18000.0, 38000.0), compressor_w=(2500.0, 5000.0), heat_s=(15.0, 45.0))
class FanAndCompressor(Law):
    """A fan with an on/off clutch and a thermostat with hysteresis, and an air compressor that alternates
    between load and idle. fan_w at 170 rad/s engine speed.
    Source: Pettersson and Johansson, Modelling and Control of Auxiliary Loads in Heavy Vehicles, Int. J.
    Control 79 (2006); fan torque with speed squared, SAE J1342."""

    def start(self, batch: int) -> dict[str, Array]:
        rng = self.rng(7)
        return {
            "heat": rng.uniform(0.0, 1.0, batch),
            "on": np.zeros(batch),
            "tank": rng.uniform(0.7, 1.0, batch),
            "pumping": np.zeros(batch),
        }

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        load = self.power_share(view)
        s.heat += dt * (0.25 + 1.2 * load - 1.1 * s.on) / p.heat_s  # 1: the fan comes on
        s.heat = np.clip(s.heat, 0.0, 1.2)
        s.on = np.where(s.heat > 1.0, 1.0, np.where(s.heat < 0.35, 0.0, s.on))
        # 1/s of a full tank: leaks, braking by 20 kN, the compressor
        s.tank -= dt * (0.004 + 0.03 * np.clip(view.brake_force / 2e4, 0.0, 1.0) - 0.02 * s.pumping)
        s.pumping = np.where(s.tank < 0.75, 1.0, np.where(s.tank > 0.95, 0.0, s.pumping))
        w = np.maximum(view.engine_speed, 40.0)
        torque = s.on * p.fan_w * w**2 / 170.0**3 + s.pumping * p.compressor_w / w
        return -self.at_wheels(view, torque) * moving(view)


@law("engine_brake", "descent hills suburban", accepts="engine_friction")
@sizes(torque_nm=(250.0, 800.0), exponent=(1.4, 2.1), delay_s=(0.3, 0.6), from_mps=(7.0, 12.0))
class CompressionBrake(Law, closed=0.0, torque=0.0):
    """A compression release brake in stages, switched by the driver; the switch is not recorded.
    Source: Heywood, Internal Combustion Engine Fundamentals, on compression work; SAE J1939-71, SPN 520,
    retarder torque."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        closed = (view.u[:, 0] <= 0.01 * abs(self.truck.full_command)) & (view.speed > p.from_mps)
        s.closed = np.where(closed & (view.shifting == 0.0), s.closed + dt, 0.0)
        stages = np.clip(np.floor((s.closed - p.delay_s) / 0.4 + 1.0), 0.0, 3.0) / 3.0
        wanted = stages * p.torque_nm * np.clip(view.engine_speed / 180.0, 0.0, 1.3) ** p.exponent
        s.torque += dt * (wanted - s.torque) / 0.08  # s, a cycle or two of the engine
        return -self.at_wheels(view, s.torque) * moving(view)


@law("engine_brake", "descent suburban", accepts="engine_friction")
@sizes(torque_nm=(280.0, 650.0), fill=(0.6, 1.8), cut_out_rpm=(850.0, 1000.0), limit=(0.7, 1.0))
class ExhaustFlap(Law, shut=0.0, pressure=0.0):
    """An unrecorded exhaust brake, closed by the first touch of the brake pedal and opened by the throttle.
    fill: manifold fillings per second at 1500 rpm (157 rad/s); it empties six times per second.
    Source: Heywood, Internal Combustion Engine Fundamentals, ch. 13, on pumping against a throttled exhaust.
    """

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        throttle = view.u[:, 0] > 0.01 * abs(self.truck.full_command)
        fast = view.engine_speed * 30.0 / np.pi > p.cut_out_rpm
        s.shut = np.where(throttle | ~fast, 0.0, np.where(view.u[:, 1] > 0.02, 1.0, s.shut))
        flow = p.fill * view.engine_speed / 157.0
        s.pressure += dt * np.where(s.shut > 0.0, flow * (1.2 - s.pressure), -6.0 * s.pressure)
        back = np.minimum(s.pressure, p.limit)
        return -self.at_wheels(view, p.torque_nm * back) * moving(view)


@law("engine_friction", accepts="engine_brake accessory_load")
@sizes(cold_c=(-20.0, 10.0), exponent=(0.25, 0.40), warm_s=(150.0, 500.0))
class ColdOil(Law):
    """Motoring friction in a cold start increases with a power of oil viscosity; a share of 0.55 of it is
    rubbing friction. Warm oil is at 95 degC.
    Source: Shayler, Leong and Murphy, SAE 2005-01-1654; viscosity by Vogel's equation."""

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


@law("engine_friction", accepts="engine_brake accessory_load")
@sizes(rings_nm=(40.0, 110.0), pumping_nm=(60.0, 170.0), gas=(0.01, 0.04))
class BoundaryAndPumping(Law):
    """Friction of a scuffed engine with a clogged filter. pumping_nm at 1800 rpm; gas: share of the torque
    delivered.
    Source: Patton, Nitschke and Heywood, Development and Evaluation of a Friction Model, SAE 890836: ring
    friction in the boundary regime with 1 + 1000/rpm, pumping with speed squared, gas loading with cylinder
    pressure."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        rpm = np.maximum(view.engine_speed, 55.0) * 30.0 / np.pi
        rings = p.rings_nm * (1.0 + 1000.0 / rpm)
        pumping = p.pumping_nm * (rpm / 1800.0) ** 2
        torque = rings + pumping + p.gas * np.maximum(view.engine_torque, 0.0)
        return -self.at_wheels(view, torque) * moving(view)


@law("torque_derate", "hills highway", accepts="torque_gain", reported=True)
@sizes(depth=(0.20, 0.45), from_k=(6.0, 14.0), span_k=(6.0, 14.0), block_s=(60.0, 140.0))
class CoolantDerate(Law, block=0.0, coolant=0.0):
    """Fuelling is reduced in proportion to the coolant temperature above a limit; coolant and block are two
    thermal masses with ram-air cooling. Temperatures in K above the thermostat's; at full power the block is
    60 K above the coolant, which follows with 30 s.
    Source: Heywood, Internal Combustion Engine Fundamentals, ch. 12, on heat to the coolant; SAE J1939-71,
    SPN 1569, engine protection torque derate."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        load = self.power_share(view)
        s.block += dt * (60.0 * load - (s.block - s.coolant)) / p.block_s * 2.0
        cooling = s.coolant * (0.4 + view.speed / 20.0)
        s.coolant += dt * ((s.block - s.coolant) - cooling) / 30.0
        cut = p.depth * np.clip((s.coolant - p.from_k) / p.span_k, 0.0, 1.0)
        return -self.at_wheels(view, cut * np.maximum(view.engine_torque, 0.0))


@law("torque_derate", "hills highway", accepts="torque_gain", reported=True)
@sizes(limit=(0.12, 0.26), metal_s=(5.0, 16.0), takes=(0.08, 0.2), most=(0.35, 0.55))
class ExhaustTemperatureLimit(Law, metal=0.15, cut=0.0):
    """Integral control reduces fuel while the turbine's metal is too hot, and restores it slowly. limit:
    share of the temperature rise at full torque; takes: share of torque per second and unit above the limit.
    Source: Diesel-Engine Management (Bosch), on limitation of injected quantity."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        torque = np.maximum(view.engine_torque, 0.0)
        load = (1.0 - s.cut) * torque / self.truck.peak_torque
        gas = load * np.clip(130.0 / np.maximum(view.engine_speed, 60.0), 0.6, 1.5) ** 0.6
        s.metal += dt * (gas - s.metal) / p.metal_s
        over = s.metal - p.limit
        change = np.where(over > 0.0, p.takes * over / p.limit, -0.012)
        s.cut = np.clip(s.cut + dt * change, 0.0, p.most)
        return -self.at_wheels(view, s.cut * torque)


@law("torque_limit", "suburban hills", reported=True)
@sizes(share_of_peak=(0.55, 0.80), knee_nm=(60.0, 200.0))
class SoftTorqueLimit(Law):
    """Torque is limited below the full-load curve to protect the driveline, with a soft knee.
    Source: Diesel-Engine Management (Bosch), on torque limitation."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        cap, knee = p.share_of_peak * self.truck.peak_torque, p.knee_nm
        over = view.engine_torque - cap
        lost = knee * np.logaddexp(0.0, np.clip(over / knee, -50.0, 50.0))
        return -self.at_wheels(view, np.where(over > -3.0 * knee, lost, 0.0))


@law("torque_limit", "highway", reported=True)
@sizes(set_mps=(20.5, 24.0), droop_mps=(0.5, 2.0), reset_s=(4.0, 12.0))
class RoadSpeedLimiter(Law, allowed=1.0, sum=0.0):
    """Fuelling is reduced near a set speed by proportional and integral control with a droop.
    Source: UN Regulation No. 89, speed limitation function."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        left = (p.set_mps - view.speed) / p.droop_mps
        s.sum = np.clip(s.sum + dt * left / p.reset_s, -0.3, 0.3)
        wanted = np.clip(left + s.sum + 0.3, 0.0, 1.0)
        s.allowed += np.clip(wanted - s.allowed, -1.5 * dt, 0.8 * dt)
        over = np.maximum(view.engine_torque - s.allowed * self.truck.peak_torque, 0.0)
        return -self.at_wheels(view, over)


@law("turbo_lag", "suburban hills", accepts="command_rate_limit", reported=True)
@sizes(shaft_s=(1.5, 4.0), unboosted=(0.18, 0.32))
class TurboShaft(Law, shaft=0.2):
    """The energy of the turbocharger's shaft is the integral of exhaust power minus compressor power; the
    smoke limiter caps the torque by the available air.
    Source: Eriksson and Nielsen, Modeling and Control of Engines and Drivelines (2014), ch. 8."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        full = self.truck.peak_torque
        cap = full * (p.unboosted + (1.0 - p.unboosted) * np.minimum(s.shaft, 1.0) ** 1.5)
        delivered = np.minimum(view.engine_torque, cap)
        exhaust = np.clip(delivered / full, 0.03, 1.0) * np.clip(view.engine_speed / 140.0, 0.3, 1.6)
        s.shaft += dt * (1.1 * exhaust - s.shaft**1.5) / p.shaft_s
        s.shaft = np.maximum(s.shaft, 0.05)
        return self.at_wheels(view, delivered - view.engine_torque)


@law("turbo_lag", "suburban hills", accepts="command_rate_limit", reported=True)
@sizes(growth=(0.9, 2.0), without=(0.2, 0.35), falls_s=(0.4, 1.2))
class LogisticBoost(Law, boost=0.1):
    """Boost raises exhaust power, which raises boost: it grows as a logistic curve, faster at high engine
    speed. growth: 1/s at 1200 rpm.
    Source: Watson and Janota, Turbocharging the Internal Combustion Engine (1982), on transient response."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        full = self.truck.peak_torque
        asked = np.clip((view.engine_torque / full - p.without) / (1.0 - p.without), 0.03, 1.0)
        rate = p.growth * np.clip(view.engine_speed / 125.7, 0.4, 1.8) ** 1.5
        rising = rate * s.boost * (1.0 - s.boost / asked)
        falling = (asked - s.boost) / p.falls_s
        s.boost = np.clip(s.boost + dt * np.where(asked > s.boost, rising, falling), 0.03, 1.0)
        most = full * (p.without + (1.0 - p.without) * s.boost)
        return self.at_wheels(view, np.minimum(most - view.engine_torque, 0.0))
