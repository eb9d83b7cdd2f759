"""Fourth forms of what the engine drives beside the truck; torques act at the flywheel."""

from __future__ import annotations

import numpy as np

from deeptruck_exam.hidden import Array, Hidden, hidden, moving, wheel_force
from deeptruck_model.trucks import View


@hidden(
    "viscous_fan",
    name="accessory_load",
    forms="fourth",
    source="Viscous fan clutches (suppliers' service literature): after standing the coupling is full of"
    " fluid and the fan locks until it has been pumped out, the faster the engine turns; later it engages"
    " by the air's heat with hysteresis; torque with fan speed squared; sizes are chosen here",
    ranges={
        "fan_nm": (260.0, 430.0),
        "pumps_s": (25.0, 60.0),
        "heats_s": (25.0, 60.0),
        "engages": (0.30, 0.42),
    },
    needs=("hills", "highway", "suburban"),
    accepts=("engine_friction",),
)
class ViscousFan(Hidden):
    """fan_nm: locked at 1700 rpm; pumps_s at 1000 rpm."""

    def prepare(self) -> None:
        self.stood = self.setting.rng(350).uniform(0.5, 1.0, self.setting.batch)

    def start(self, batch: int) -> dict[str, Array]:
        return {"fluid": self.stood.copy(), "heat": np.full(batch, 0.25), "valve": np.zeros(batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        watts = np.maximum(view.engine_torque, 0.0) * view.engine_speed / self.truck.peak_power
        ram = 0.2 * np.clip(view.speed / 20.0, 0.0, 1.3)
        s.heat += dt * (0.25 + np.minimum(watts, 1.0) - ram - 0.25 * s.fluid - s.heat) / p.heats_s
        s.valve = np.where(s.heat > p.engages, 1.0, np.where(s.heat < p.engages - 0.12, 0.0, s.valve))
        pumps = view.engine_speed / 104.7 / p.pumps_s
        s.fluid += dt * np.where(s.valve > 0.0, (1.0 - s.fluid) / 4.0, -pumps * (s.fluid - 0.08))
        slips = s.fluid**0.7 * view.engine_speed / 178.0
        return -wheel_force(self.setting, view, p.fan_nm * slips**2) * moving(view)


@hidden(
    "packs_on_the_go",
    name="accessory_load",
    forms="fourth",
    source="Refuse bodies that pack while the truck pulls away (body makers' manuals; NREL's refuse"
    " vocational duty cycles): a pump of fixed displacement works one stroke after every stop, pressure"
    " rising as the load is squeezed; pressures and times are chosen here",
    ranges={"torque_nm": (170.0, 330.0), "stroke_s": (5.0, 11.0), "strokes": (1.6, 3.4)},
    needs=("suburban",),
    accepts=("engine_friction",),
)
class PacksOnTheGo(Hidden):
    def start(self, batch: int) -> dict[str, Array]:
        return {"stood": np.zeros(batch), "since": np.full(batch, 1e3)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        stands = view.speed < 0.05
        s.since = np.where(stands & (s.stood > 1.0), 0.0, s.since + dt)
        s.stood = np.where(stands, s.stood + dt, 0.0)
        stroke = s.since / p.stroke_s
        works = np.floor(stroke) < np.round(p.strokes)
        most = np.minimum(p.torque_nm, 0.14 * self.truck.peak_torque)
        squeeze = 0.25 + 0.75 * (stroke - np.floor(stroke)) ** 2
        return -wheel_force(self.setting, view, most * squeeze * works) * moving(view)
