"""Hidden effects of engine and auxiliaries. Torques act at the flywheel and reach the road through the
open ratio."""

from __future__ import annotations

import numpy as np

from deeptruck_exam.hidden import Array, Hidden, hidden, moving, wheel_force
from deeptruck_model.trucks import View


@hidden(
    "turbo_lag",
    source="Eriksson and Nielsen, Modeling and Control of Engines and Drivelines (2014), ch. 8: shaft"
    " energy from exhaust"
    " power against compressor power; the smoke limiter holds the torque to the air that is there",
    ranges={"shaft_s": (1.5, 4.0), "unboosted": (0.18, 0.32)},
    needs=("suburban", "hills"),
    accepts=("command_rate_limit",),
)
class TurboShaft(Hidden):
    def start(self, batch: int) -> dict[str, Array]:
        return {"shaft": np.full(batch, 0.2)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        full = self.truck.peak_torque
        cap = full * (p.unboosted + (1.0 - p.unboosted) * np.minimum(s.shaft, 1.0) ** 1.5)
        delivered = np.minimum(view.engine_torque, cap)
        exhaust = np.clip(delivered / full, 0.03, 1.0) * np.clip(view.engine_speed / 140.0, 0.3, 1.6)
        s.shaft += dt * (1.1 * exhaust - s.shaft**1.5) / p.shaft_s
        s.shaft = np.maximum(s.shaft, 0.05)
        return wheel_force(self.setting, view, delivered - view.engine_torque)


@hidden(
    "torque_derate",
    source="Protection derate: a diesel cuts fuelling in proportion above a coolant temperature; coolant"
    " and block as two thermal masses with ram-air cooling; structure and numbers are chosen here",
    ranges={"depth": (0.20, 0.45), "from_k": (6.0, 14.0), "span_k": (6.0, 14.0), "block_s": (60.0, 140.0)},
    needs=("hills", "highway"),
    accepts=("torque_gain",),
)
class CoolantDerate(Hidden):
    """Temperatures in K above the thermostat."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"block": np.zeros(batch), "coolant": np.zeros(batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        load = np.maximum(view.engine_torque, 0.0) * view.engine_speed / self.truck.peak_power
        s.block += dt * (60.0 * load - (s.block - s.coolant)) / p.block_s * 2.0
        cooling = s.coolant * (0.4 + view.speed / 20.0)
        s.coolant += dt * ((s.block - s.coolant) - cooling) / 30.0
        cut = p.depth * np.clip((s.coolant - p.from_k) / p.span_k, 0.0, 1.0)
        return -wheel_force(self.setting, view, cut * np.maximum(view.engine_torque, 0.0))


@hidden(
    "torque_limit",
    source="Electronic torque limiter of heavy engines, which hold torque below the full-load curve to"
    " spare the driveline; the soft knee is chosen here",
    ranges={"share_of_peak": (0.55, 0.80), "knee_nm": (60.0, 200.0)},
    needs=("suburban", "hills"),
)
class SoftLimiter(Hidden):
    def newtons(self, view: View, dt: float) -> Array:
        cap, knee = self.p.share_of_peak * self.truck.peak_torque, self.p.knee_nm
        over = view.engine_torque - cap
        lost = knee * np.logaddexp(0.0, np.clip(over / knee, -50.0, 50.0))
        return -wheel_force(self.setting, view, np.where(over > -3.0 * knee, lost, 0.0))


@hidden(
    "engine_friction",
    source="Shayler, Leong and Murphy, SAE 2005-01-1654: motoring friction rises with a power of oil"
    " viscosity, here by Vogel's equation, in a cold start; exponent range and warm-up are chosen here",
    ranges={"cold_c": (-20.0, 10.0), "exponent": (0.25, 0.40), "warm_s": (150.0, 500.0)},
    accepts=("engine_brake", "accessory_load"),
)
class ColdOil(Hidden):
    def prepare(self) -> None:
        self.first = self.p.cold_c + self.setting.rng(6).uniform(0.0, 25.0, self.setting.batch)

    def start(self, batch: int) -> dict[str, Array]:
        return {"oil": self.first.copy()}

    def newtons(self, view: View, dt: float) -> Array:
        p, s, t = self.p, self.s, self.truck
        ratio = np.exp(1040.0 / (s.oil + 122.0) - 1040.0 / (95.0 + 122.0))  # Vogel, 15W-40
        w = np.maximum(view.engine_speed, 40.0)
        hot = t.friction_constant + t.friction_linear * w + t.friction_quadratic * w * w
        load = 0.35 + np.maximum(view.engine_torque, 0.0) / self.truck.peak_torque
        s.oil += dt * (95.0 - s.oil) * load / p.warm_s
        return -wheel_force(self.setting, view, 0.55 * hot * (ratio**p.exponent - 1.0)) * moving(view)


@hidden(
    "accessory_load",
    source="Fan by the affinity laws (power with speed cubed) through an on/off clutch with thermostat"
    " hysteresis; compressor in load and unload cycles; powers of a heavy truck, chosen here",
    ranges={"fan_w": (18000.0, 38000.0), "compressor_w": (2500.0, 5000.0), "heat_s": (15.0, 45.0)},
    needs=("hills", "highway", "suburban"),
    accepts=("engine_friction",),
)
class ThermostatFan(Hidden):
    """fan_w at 170 rad/s engine speed."""

    def start(self, batch: int) -> dict[str, Array]:
        rng = self.setting.rng(7)
        return {
            "heat": rng.uniform(0.0, 1.0, batch),
            "on": np.zeros(batch),
            "tank": rng.uniform(0.7, 1.0, batch),
            "pumping": np.zeros(batch),
        }

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        load = np.maximum(view.engine_torque, 0.0) * view.engine_speed / self.truck.peak_power
        s.heat += dt * (0.25 + 1.2 * load - 1.1 * s.on) / p.heat_s
        s.heat = np.clip(s.heat, 0.0, 1.2)
        s.on = np.where(s.heat > 1.0, 1.0, np.where(s.heat < 0.35, 0.0, s.on))
        s.tank -= dt * (0.004 + 0.03 * np.clip(view.brake_force / 2e4, 0.0, 1.0) - 0.02 * s.pumping)
        s.pumping = np.where(s.tank < 0.75, 1.0, np.where(s.tank > 0.95, 0.0, s.pumping))
        w = np.maximum(view.engine_speed, 40.0)
        torque = s.on * p.fan_w * w**2 / 170.0**3 + s.pumping * p.compressor_w / w
        return -wheel_force(self.setting, view, torque) * moving(view)
