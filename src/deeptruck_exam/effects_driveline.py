"""Hidden effects between flywheel and wheel."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from deeptruck_exam.hidden import (
    Array,
    Effect,
    Hidden,
    Planted,
    Setting,
    hidden,
    moving,
    register,
    weight,
)
from deeptruck_model.trucks import View


@hidden(
    "driveline_loss",
    source="ISO/TR 14179-2 mesh losses in proportion to load, either way; Changenet and Velex, J. Mech."
    " Des. 129 (2007):"
    " churning with the power 1.5 of speed",
    ranges={"mesh": (0.05, 0.11), "churning_n": (100.0, 500.0)},  # churning at 20 m/s
    accepts=("torque_gain",),
)
class MeshAndChurning(Hidden):
    def newtons(self, view: View, dt: float) -> Array:
        churning = self.p.churning_n * np.maximum(view.speed / 20.0, 0.0) ** 1.5
        return -(self.p.mesh * np.abs(view.traction_force) + churning) * moving(view)


@hidden(
    "shift_interruption",
    source="Pettersson and Nielsen, Gear Shifting by Engine Control, IEEE Trans. Control Syst. Technol. 8"
    " (2000): torque held off until driveline oscillation has died; hold and raised-cosine return are"
    " chosen here",
    ranges={"hold_s": (0.3, 0.9), "return_s": (0.4, 1.0)},
    needs=("suburban", "hills"),
)
class LateReturn(Hidden):
    def start(self, batch: int) -> dict[str, Array]:
        return {"since": np.full(batch, 99.0), "gear": np.full(batch, -1.0)}

    def newtons(self, view: View, dt: float) -> Array:
        s = self.s
        changed = (s.gear >= 0.0) & (view.gear != s.gear)
        s.since = np.where(changed | (view.shifting > 0.0), 0.0, s.since + dt)
        s.gear = view.gear.copy()
        back = np.clip((s.since - self.p.hold_s) / self.p.return_s, 0.0, 1.0)
        held = 0.5 * (1.0 + np.cos(np.pi * back))
        return -held * np.maximum(view.traction_force, 0.0)


def _lockup_fails(setting: Setting, p: SimpleNamespace) -> Planted:
    return Planted(
        parameters={
            "lockup_gear": 7.0,
            "stall_capacity": setting.truck.stall_capacity * p.capacity,
        }
    )


register(
    Effect(
        "torque_converter_slip",
        "torque_converter_slip",
        "missing_physics",
        "Hrovat and Tobler, Bond Graph Modeling of Automotive Torque Converters, J. Franklin Institute 319"
        " (1985); here the lock-up clutch is inoperative and worn blades lower the capacity",
        {"capacity": (0.35, 0.75)},
        _lockup_fails,
        needs=("suburban", "hills", "highway"),
        trucks=("freightliner",),
        accepts=("driveline_loss",),
    )
)


@hidden(
    "rotating_inertia",
    source="Wong, Theory of Ground Vehicles (2008), sec. 3.4.2 (mass factor 0.04 + 0.0025 ratio^2): a"
    " mixer's hydraulic"
    " motor and a heavy flywheel turn with the engine, massive wheels with the road",
    ranges={"engine_kgm2": (4.0, 10.0), "wheels_kgm2": (20.0, 150.0)},
    needs=("suburban", "hills"),
    accepts=("mass", "payload_change"),
)
class HeavyFlywheel(Hidden):
    def newtons(self, view: View, dt: float) -> Array:
        r2 = self.truck.wheel_radius**2
        engine = self.p.engine_kgm2 * view.ratio**2 * (1.0 - view.shifting) * (view.speed > 1.5)
        extra = np.minimum((engine + self.p.wheels_kgm2) / r2, 0.8 * view.effective_mass)
        return -extra * view.acceleration * moving(view)


@hidden(
    "driveline_backlash",
    source="Lagerberg and Egardt, IEEE Trans. Control Syst. Technol. 15 (2007): dead zone at torque"
    " reversal, then a"
    " damped shuffle of 2-4 Hz when the teeth meet",
    ranges={
        "gap_s": (0.15, 0.5),
        "shuffle_hz": (1.5, 3.0),
        "damping": (0.10, 0.25),
        "clonk": (0.3, 0.7),
    },
    needs=("suburban", "hills"),
)
class DeadZone(Hidden):
    def start(self, batch: int) -> dict[str, Array]:
        return {"side": np.ones(batch), "since": np.full(batch, 99.0), "jump": np.zeros(batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        side = np.where(np.abs(view.traction_force) > 200.0, np.sign(view.traction_force), s.side)
        crossed = side != s.side
        s.since = np.where(crossed, 0.0, s.since + dt)
        s.side = side
        open_now = s.since < p.gap_s
        s.jump = np.where(open_now, view.traction_force, s.jump)
        t = s.since - p.gap_s
        omega = 2.0 * np.pi * p.shuffle_hz
        size = np.clip(s.jump, -0.08 * weight(view), 0.08 * weight(view))
        ring = p.clonk * size * np.exp(-p.damping * omega * t) * np.cos(omega * t)
        return np.where(open_now, -view.traction_force, np.where(t < 4.0, ring, 0.0)) * moving(view)
