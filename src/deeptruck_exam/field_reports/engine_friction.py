"""Fourth forms of the engine's own losses; torques act at the flywheel."""

from __future__ import annotations

import numpy as np

from deeptruck_exam.hidden import Array, Hidden, hidden, moving, wheel_force
from deeptruck_model.trucks import View


@hidden(
    "chen_and_flynn",
    name="engine_friction",
    forms="fourth",
    source="Chen and Flynn, Development of a Single Cylinder Compression Ignition Research Engine, SAE"
    " 650733: friction as a constant, the peak cylinder pressure, and piston speed with its square; several"
    " times a sound engine's, as after a liner has scored; sizes chosen here",
    ranges={
        "constant_nm": (20.0, 60.0),
        "peak_nm": (50.0, 130.0),
        "speed_nm": (25.0, 80.0),
        "boost": (0.2, 0.6),
    },
    accepts=("engine_brake", "accessory_load"),
)
class ChenAndFlynn(Hidden):
    """peak_nm at full load, speed_nm at 1500 rpm; peak pressure follows the load as boost builds up."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"pressure": np.full(batch, 0.3)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        load = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.1)
        s.pressure += dt * (0.35 + 0.65 * load - s.pressure) / p.boost
        pace = view.engine_speed / 157.0
        torque = p.constant_nm + p.peak_nm * s.pressure + p.speed_nm * (0.6 * pace + 0.4 * pace**2)
        return -wheel_force(self.setting, view, torque) * moving(view)


@hidden(
    "kept_hot",
    name="engine_friction",
    forms="fourth",
    source="Thermal management of aftertreatment (Stanton, Systematic Development of Highly Efficient and"
    " Clean Engines to Meet Future Commercial Vehicle Greenhouse Gas Regulations, SAE 2013-01-2421): below a"
    " catalyst temperature turbine vanes or a flap close, and pumping work grows; on and off by a heat that"
    " follows the load; sizes are chosen here",
    ranges={
        "torque_nm": (110.0, 240.0),
        "on_c": (215.0, 250.0),
        "off_c": (262.0, 300.0),
        "heats_s": (12.0, 30.0),
    },
    needs=("suburban", "hills", "highway"),
    accepts=("engine_brake", "accessory_load"),
)
class KeptHot(Hidden):
    """torque_nm: at 1340 rpm without load."""

    def start(self, batch: int) -> dict[str, Array]:
        gas = self.setting.rng(342).uniform(180.0, 320.0, batch)
        return {"gas": gas, "on": (gas < self.p.on_c).astype(float), "shut": np.zeros(batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        load = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.0)
        s.gas += dt * (140.0 + 330.0 * np.sqrt(load) + 25.0 * s.on - s.gas) / p.heats_s
        s.on = np.where(s.gas < p.on_c, 1.0, np.where(s.gas > p.off_c, 0.0, s.on))
        s.shut += dt * (s.on - s.shut) / 0.8
        torque = p.torque_nm * s.shut * (view.engine_speed / 140.0) * (1.0 - 0.5 * load)
        return -wheel_force(self.setting, view, torque) * moving(view)
