"""Second forms of engine and auxiliaries; torques act at the flywheel."""

from __future__ import annotations

import numpy as np

from deeptruck_exam.hidden import Array, Hidden, hidden, moving, wheel_force
from deeptruck_model.trucks import View


@hidden(
    "boost_feeds_itself",
    name="turbo_lag",
    forms="second",
    source="Watson and Janota, Turbocharging the Internal Combustion Engine (1982): boost raises the"
    " exhaust that raises boost, so that it grows as a logistic curve, faster at high engine speed; the"
    " collapse at closed throttle and the rates are chosen here",
    ranges={"growth": (0.9, 2.0), "without": (0.2, 0.35), "falls_s": (0.4, 1.2)},
    needs=("suburban", "hills"),
    accepts=("command_rate_limit",),
)
class BoostFeedsItself(Hidden):
    """growth: 1/s at 1200 rpm; nothing for a second, then all at once."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"boost": np.full(batch, 0.1)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s, full = self.p, self.s, self.truck.peak_torque
        asked = np.clip((view.engine_torque / full - p.without) / (1.0 - p.without), 0.03, 1.0)
        rate = p.growth * np.clip(view.engine_speed / 125.7, 0.4, 1.8) ** 1.5
        rising = rate * s.boost * (1.0 - s.boost / asked)
        falling = (asked - s.boost) / p.falls_s
        s.boost = np.clip(s.boost + dt * np.where(asked > s.boost, rising, falling), 0.03, 1.0)
        most = full * (p.without + (1.0 - p.without) * s.boost)
        return wheel_force(self.setting, view, np.minimum(most - view.engine_torque, 0.0))


@hidden(
    "staged_protection",
    name="torque_derate",
    forms="second",
    source="Derates of engine protection come as a step, over a ramp, and stay until well below the limit;"
    " heat soak of the charge air in slow driving, steps and limits are chosen here",
    ranges={"step": (0.20, 0.38), "limit": (0.17, 0.33), "band": (0.12, 0.3), "soak_s": (18.0, 45.0)},
    needs=("hills", "suburban"),
    accepts=("torque_gain",),
)
class StagedProtection(Hidden):
    """Charge-air heat: 1 for full power at walking pace."""

    def start(self, batch: int) -> dict[str, Array]:
        return {
            "heat": self.setting.rng(140).uniform(0.0, 0.3, batch),
            "on": np.zeros(batch),
            "cut": np.zeros(batch),
        }

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        power = np.maximum(view.engine_torque, 0.0) * view.engine_speed / self.truck.peak_power
        through = 1.0 + np.maximum(view.speed, 0.0) / 25.0  # ram air
        s.heat += dt * (1.4 * power / through - s.heat) / p.soak_s
        s.on = np.where(s.heat > p.limit, 1.0, np.where(s.heat < p.limit * (1.0 - p.band), 0.0, s.on))
        s.cut += np.clip(p.step * s.on - s.cut, -0.10 * dt, 0.10 * dt)
        return -wheel_force(self.setting, view, s.cut * np.maximum(view.engine_torque, 0.0))


@hidden(
    "road_speed_limiter",
    name="torque_limit",
    forms="second",
    source="Speed limitation function, UN Regulation No. 89: fuelling taken back near the set speed, with a"
    " droop and a stabilised overshoot; droop and rates are chosen here",
    ranges={"set_mps": (20.5, 24.0), "droop_mps": (0.5, 2.0), "reset_s": (4.0, 12.0)},
    needs=("highway",),
)
class RoadSpeedLimiter(Hidden):
    """Proportional and integral: the integral opens a little above the set speed's droop."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"allowed": np.ones(batch), "sum": np.zeros(batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        left = (p.set_mps - view.speed) / p.droop_mps
        s.sum = np.clip(s.sum + dt * left / p.reset_s, -0.3, 0.3)
        wanted = np.clip(left + s.sum + 0.3, 0.0, 1.0)
        s.allowed += np.clip(wanted - s.allowed, -1.5 * dt, 0.8 * dt)
        over = np.maximum(view.engine_torque - s.allowed * self.truck.peak_torque, 0.0)
        return -wheel_force(self.setting, view, over)


@hidden(
    "boundary_and_pumping",
    name="engine_friction",
    forms="second",
    source="Patton, Nitschke and Heywood, Development and Evaluation of a Friction Model, SAE 890836: ring"
    " friction in the boundary regime with 1 + 1000/rpm, pumping through intake and exhaust with speed"
    " squared, gas loading with cylinder pressure; sizes of a scuffed engine with a clogged filter",
    ranges={"rings_nm": (40.0, 110.0), "pumping_nm": (60.0, 170.0), "gas": (0.01, 0.04)},
    accepts=("engine_brake", "accessory_load"),
)
class BoundaryAndPumping(Hidden):
    """pumping_nm at 1800 rpm; gas: of the torque delivered."""

    def newtons(self, view: View, dt: float) -> Array:
        rpm = np.maximum(view.engine_speed, 55.0) * 30.0 / np.pi
        rings = self.p.rings_nm * (1.0 + 1000.0 / rpm)
        pumping = self.p.pumping_nm * (rpm / 1800.0) ** 2
        torque = rings + pumping + self.p.gas * np.maximum(view.engine_torque, 0.0)
        return -wheel_force(self.setting, view, torque) * moving(view)


@hidden(
    "cooling_compressor",
    name="accessory_load",
    forms="second",
    source="Transport refrigeration or a vacuum pump of fixed displacement on the engine: torque does not"
    " depend on speed, and running is timed by the load's own heat; duty, surge and sizes are chosen here",
    ranges={
        "torque_nm": (130.0, 300.0),
        "on_s": (25.0, 70.0),
        "off_s": (20.0, 60.0),
        "surge": (0.2, 0.6),
    },
    needs=("hills", "highway", "suburban"),
    accepts=("engine_friction",),
)
class CoolingCompressor(Hidden):
    """Works in its own rhythm, whatever the truck does."""

    def prepare(self) -> None:
        rng, batch = self.setting.rng(141), self.setting.batch
        self.first = rng.uniform(0.0, self.p.on_s + self.p.off_s, batch)
        self.pace = rng.uniform(0.85, 1.2, batch)

    def start(self, batch: int) -> dict[str, Array]:
        return {"torque": np.zeros(batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        within = (self.first + self.pace * view.time) % (p.on_s + p.off_s)
        surge = 1.0 + p.surge * np.exp(-within / 3.0)
        wanted = np.where(within < p.on_s, p.torque_nm * surge, 0.0)
        s.torque += dt * (wanted - s.torque) / 0.7
        return -wheel_force(self.setting, view, s.torque) * moving(view)
