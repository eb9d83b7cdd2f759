"""Fourth forms of the engine brake: with the pedal, and by a regulated back pressure."""

from __future__ import annotations

import numpy as np

from deeptruck_exam.hidden import Array, Hidden, hidden, moving, some_drives, wheel_force
from deeptruck_model.trucks import View

ENGINE_BRAKE_RPM = np.array([900.0, 1200.0, 1500.0, 1800.0, 2100.0])
ENGINE_BRAKE = np.array([0.22, 0.40, 0.58, 0.80, 1.0])


@hidden(
    "engine_brake_with_pedal",
    name="engine_brake",
    forms="fourth",
    source="Engine-brake mode 'with service brake' of heavy diesels (owner's manuals, Detroit and Cummins"
    " electronic features): the compression brake comes in with the brake pedal and stays a moment after"
    " it; retarding torque over speed as in suppliers' tables; times and sizes chosen here",
    ranges={"torque_nm": (450.0, 1100.0), "after_s": (0.3, 0.9), "stays_s": (1.0, 4.0)},
    needs=("descent", "suburban", "hills"),
    accepts=("engine_friction",),
)
class EngineBrakeWithPedal(Hidden):
    """torque_nm: at 2100 rpm. The least touch of the pedal has all of it."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"pressed": np.zeros(batch), "left": np.zeros(batch), "torque": np.zeros(batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        s.pressed = np.where(view.u[:, 1] > 0.02, s.pressed + dt, 0.0)
        s.left = np.where(s.pressed > p.after_s, p.stays_s, np.maximum(s.left - dt, 0.0))
        s.left = np.where(view.u[:, 0] > 0.01 * abs(self.truck.full_command), 0.0, s.left)
        rpm = view.engine_speed * 30.0 / np.pi
        able = np.interp(rpm, ENGINE_BRAKE_RPM, ENGINE_BRAKE) * (rpm > 950.0)
        s.torque += dt * (p.torque_nm * able * (s.left > 0.0) - s.torque) / 0.15
        return -wheel_force(self.setting, view, s.torque) * moving(view)


@hidden(
    "regulated_exhaust_brake",
    name="engine_brake",
    forms="fourth",
    source="Exhaust brakes whose back-pressure valve holds the manifold at a set pressure (data sheets of"
    " constant-pressure exhaust brakes): torque with engine speed squared up to a knee, constant above; a"
    " dash switch that is on in some drives; sizes are chosen here",
    ranges={"torque_nm": (240.0, 520.0), "knee_rpm": (1200.0, 1700.0), "share_of_drives": (0.5, 0.8)},
    needs=("descent", "hills"),
    accepts=("engine_friction",),
)
class RegulatedExhaustBrake(Hidden):
    """The switch is moved once in some drives, and nobody records it."""

    def prepare(self) -> None:
        rng, batch = self.setting.rng(312), self.setting.batch
        drives = some_drives(rng, batch, self.p.share_of_drives)
        moved = np.where(rng.random(batch) < 0.4, rng.uniform(0.1, 0.5, batch), 0.0)
        self.from_s = np.where(drives, moved * self.setting.duration_s, np.inf)

    def start(self, batch: int) -> dict[str, Array]:
        return {"shut": np.zeros(batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, rpm = self.p, view.engine_speed * 30.0 / np.pi
        closed = (view.u[:, 0] <= 0.01 * abs(self.truck.full_command)) & (rpm > 900.0)
        wanted = closed & (view.time >= self.from_s)
        self.s.shut += dt * (wanted - self.s.shut) / np.where(wanted, 0.5, 0.1)
        torque = p.torque_nm * np.minimum((rpm / p.knee_rpm) ** 2, 1.0) * self.s.shut
        return -wheel_force(self.setting, view, torque) * moving(view)
