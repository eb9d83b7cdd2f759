"""Second forms in the brakes: stroke, relay valve, spring brakes without air, exhaust flap."""

from __future__ import annotations

import numpy as np

from deeptruck_exam.hidden import Array, Hidden, hidden, moving, wheel_force
from deeptruck_model.trucks import View


@hidden(
    "stroke_runs_out",
    name="brake_fade",
    forms="second",
    source="Heusser, Heavy Truck Deceleration Rates as a Function of Brake Adjustment, SAE 910126: hot drums"
    " grow, the push rod strokes further, and past the readjustment limit the chamber's force drops"
    " steeply; cooling by convection and radiation, numbers chosen here",
    ranges={
        "cold_stroke": (0.50, 0.68),  # of the stroke at which the force begins to drop
        "per_100k": (0.20, 0.38),
        "per_force": (0.10, 0.25),  # elastic stretch at full application
        "steepness": (1.2, 2.2),
        "share": (0.35, 0.65),  # of the brake force that is out of adjustment
    },
    needs=("descent",),
)
class StrokeRunsOut(Hidden):
    """Hot alone or hard alone costs little, hot and hard costs most."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"drum": np.full(batch, self.truck.ambient_temperature + 30.0)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s, truck = self.p, self.s, self.truck
        above = s.drum - truck.ambient_temperature
        applied = view.brake_force / (0.4 * truck.brake_capacity)
        stroke = p.cold_stroke + p.per_100k * above / 100.0 + p.per_force * np.clip(applied, 0.0, 1.5)
        lost = p.share * (1.0 - np.exp(-p.steepness * np.maximum(stroke - 1.0, 0.0)))
        hot, cold = (s.drum + 273.0) / 100.0, (truck.ambient_temperature + 273.0) / 100.0
        convection = (truck.brake_cooling + truck.brake_cooling_speed * np.maximum(view.speed, 0.0)) * above
        radiation = 10.0 * (hot**4 - cold**4)  # W; 2 m2 of drums
        power = (1.0 - lost) * view.brake_force * np.maximum(view.speed, 0.0)
        s.drum += dt * (power - convection - radiation) / (0.7 * truck.brake_heat_capacity)
        return lost * view.brake_force * moving(view)


@hidden(
    "relay_valve_sticks",
    name="brake_lag",
    forms="second",
    source="Natarajan, Subramanian, Darbha and Rajagopal, A Model of the Relay Valve Used in an Air Brake"
    " System, Nonlinear Analysis: Hybrid Systems 1 (2007): the valve laps until the difference exceeds a"
    " crack pressure, then fills choked; band and rates are chosen here",
    ranges={
        "share": (0.55, 0.9),  # of the brake force behind the valve
        "crack": (0.012, 0.035),  # of full force
        "fill": (0.12, 0.30),  # 1/s of full force
        "empty_s": (0.5, 1.3),
    },
    needs=("suburban", "descent"),
    accepts=("command_delay", "clock_offset"),
)
class RelayValve(Hidden):
    """Small changes never arrive; large ones arrive at a constant rate and leave exponentially."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"chamber": np.zeros(batch), "open": np.zeros(batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s, full = self.p, self.s, self.truck.brake_capacity
        asked = view.brake_force / full
        away = asked - s.chamber
        released = (asked < 0.002) & (s.chamber > 0.0)  # a quick-release valve needs no crack pressure
        s.open = np.where((np.abs(away) > p.crack) | released, 1.0, s.open * (np.abs(away) > 0.2 * p.crack))
        change = np.where(away > 0.0, np.minimum(p.fill * dt, away), away * min(dt / p.empty_s, 1.0))
        s.chamber += s.open * change
        return p.share * full * (asked - s.chamber) * moving(view)


@hidden(
    "spring_brakes_creep",
    name="dragging_brake",
    forms="second",
    source="Spring brakes apply when their air falls short (Limpert, Brake Design and Safety, on spring"
    " brakes; FMVSS 121 S5.1 on the compressor's build-up with engine speed); leak and numbers are chosen"
    " here",
    ranges={
        "hold_bar": (5.6, 6.4),
        "per_bar_n": (2200.0, 4500.0),
        "use_bar": (0.10, 0.25),  # for each second of firm braking
        "refill_s": (20.0, 45.0),
    },
    needs=("suburban", "descent"),
)
class SpringBrakesCreep(Hidden):
    """Every application draws air; the faster the engine turns, the sooner the shoes let go."""

    def prepare(self) -> None:
        self.first = self.setting.rng(104).uniform(4.8, 6.6, self.setting.batch)

    def start(self, batch: int) -> dict[str, Array]:
        return {"air": self.first.copy()}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        used = p.use_bar * np.clip(view.brake_force / 2.5e4, 0.0, 1.5)
        refill = np.clip(view.engine_speed / 130.0, 0.4, 1.6) * (7.5 - s.air) / p.refill_s
        s.air = np.clip(s.air + dt * (refill - used - 0.012), 3.5, 7.5)
        short = np.maximum(p.hold_bar - s.air, 0.0)
        return -p.per_bar_n * np.minimum(short, 1.5) * moving(view)


@hidden(
    "exhaust_flap",
    name="engine_brake",
    forms="second",
    source="Exhaust brake: pumping work against a throttled exhaust (Heywood, Internal Combustion Engine"
    " Fundamentals, ch. 13, on pumping), back pressure limited by the valve springs; the latch on the"
    " brake pedal and the numbers are chosen here",
    ranges={
        "torque_nm": (280.0, 650.0),
        "fill": (0.6, 1.8),  # manifold fillings a second at 1500 rpm
        "cut_out_rpm": (850.0, 1000.0),
        "limit": (0.7, 1.0),
    },
    needs=("descent", "suburban"),
    accepts=("engine_friction",),
)
class ExhaustFlap(Hidden):
    """Closed by the first touch of the brake pedal, opened by the throttle, and never recorded."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"shut": np.zeros(batch), "pressure": np.zeros(batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        throttle = view.u[:, 0] > 0.01 * abs(self.truck.full_command)
        fast = view.engine_speed * 30.0 / np.pi > p.cut_out_rpm
        s.shut = np.where(throttle | ~fast, 0.0, np.where(view.u[:, 1] > 0.02, 1.0, s.shut))
        flow = p.fill * view.engine_speed / 157.0
        s.pressure += dt * np.where(s.shut > 0.0, flow * (1.2 - s.pressure), -6.0 * s.pressure)
        back = np.minimum(s.pressure, p.limit)
        return -wheel_force(self.setting, view, p.torque_nm * back) * moving(view)
