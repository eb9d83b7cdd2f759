"""Second forms between flywheel and wheel."""

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
    wheel_force,
)
from deeptruck_model.trucks import View


@hidden(
    "countershaft_and_hypoid",
    name="driveline_loss",
    forms="second",
    source="Naunheimer, Bertsche, Ryborz and Novak, Automotive Transmissions (2011), on losses: the direct"
    " gear passes no mesh of the countershaft, the others two; hypoid axles lose more on the coast flank;"
    " drag of cold oil falls as the loss itself heats it; sizes are chosen here",
    ranges={
        "countershaft": (0.06, 0.12),
        "axle": (0.02, 0.05),
        "coast": (1.5, 3.0),
        "cold_nm": (30.0, 90.0),  # at the flywheel
        "heat_j": (0.6e6, 2.0e6),
    },
    accepts=("torque_gain",),
)
class CountershaftAndHypoid(Hidden):
    def start(self, batch: int) -> dict[str, Array]:
        return {"heat": np.zeros(batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        direct = np.abs(view.ratio / self.truck.final_drive - 1.0) < 0.05
        share = p.axle * np.where(view.traction_force < 0.0, p.coast, 1.0) + p.countershaft * ~direct
        cold = wheel_force(self.setting, view, p.cold_nm * np.exp(-s.heat))
        lost = share * np.abs(view.traction_force) + cold
        s.heat += dt * lost * np.maximum(view.speed, 0.0) / p.heat_j
        return -lost * moving(view)


@hidden(
    "clutch_meters_in",
    name="shift_interruption",
    forms="second",
    source="Friction phase of a launch clutch after a change: speed difference of the step times engine"
    " inertia over the clutch's slope, Naunheimer et al., Automotive Transmissions (2011), on shifting"
    " elements; torque returns at a metered rate, numbers chosen here",
    ranges={"sync_s": (0.6, 1.8), "metered": (0.25, 0.7), "down": (1.0, 2.0)},
    needs=("suburban", "hills"),
)
class ClutchMetersIn(Hidden):
    """sync_s: open for each unit of the logarithm of the step; metered: share of 0.1 g a second."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"ratio": np.zeros(batch), "open": np.zeros(batch), "carried": np.full(batch, 1e6)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        engaged = (view.shifting == 0.0) & (view.ratio > 0.0)
        step = np.log(np.maximum(view.ratio, 0.1) / np.where(s.ratio > 0.0, s.ratio, view.ratio + 0.1))
        changed = engaged & (s.ratio > 0.0) & (np.abs(step) > 0.02)
        wait = p.sync_s * np.abs(step) * np.where(step > 0.0, p.down, 1.0)
        s.open = np.where(changed, np.minimum(wait, 1.5), np.maximum(s.open - dt * engaged, 0.0))
        s.ratio = np.where(engaged, view.ratio, s.ratio)
        rate = p.metered * view.mass
        s.carried = np.where(s.open > 0.0, 0.0, np.minimum(s.carried + rate * dt, 1e6))
        pull = view.traction_force
        return (np.clip(pull, -s.carried, s.carried) - pull) * engaged * moving(view)


def _stator_freewheels(setting: Setting, p: SimpleNamespace) -> Planted:
    truck = setting.truck
    return Planted(
        parameters={
            "stall_torque_ratio": 1.0 + p.left * (truck.stall_torque_ratio - 1.0),
            "coupling_ratio": 0.9 * truck.coupling_ratio,
            "lockup_speed": truck.lockup_speed * p.late,
            "lockup_release_speed": truck.lockup_release_speed * p.late,
        }
    )


register(
    Effect(
        "stator_freewheels",
        "torque_converter_slip",
        "missing_physics",
        "Stator whose one-way clutch does not hold: no torque multiplication below coupling (Naunheimer et"
        " al., Automotive Transmissions, 2011, on converters); lock-up postponed to higher speeds, chosen"
        " here",
        {"left": (0.05, 0.3), "late": (1.35, 1.7)},
        _stator_freewheels,
        needs=("suburban", "hills"),
        trucks=("freightliner",),
        accepts=("driveline_loss",),
        forms="second",
    )
)


@hidden(
    "damped_flywheel",
    name="rotating_inertia",
    forms="second",
    source="Second inertia behind a torsional damper, as in dual-mass flywheels (Reik, LuK Symposium, 1990)"
    " or a pump on the power take-off; viscous coupling and sizes are chosen here",
    ranges={"inertia": (5.0, 12.0), "coupling_s": (0.15, 0.6), "wheels_kg": (200.0, 900.0)},
    needs=("suburban", "hills"),
    accepts=("mass", "payload_change"),
)
class DampedFlywheel(Hidden):
    """inertia: kg m2 at engine speed; wheels_kg: rim mass of dual wheels, as if at the tread."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"rotor": np.full(batch, -1.0)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        s.rotor = np.where(s.rotor < 0.0, view.engine_speed, s.rotor)
        torque = p.inertia * (view.engine_speed - s.rotor) / p.coupling_s
        s.rotor = s.rotor + dt * (view.engine_speed - s.rotor) / p.coupling_s
        locked = (view.shifting == 0.0) & (view.speed > 1.5)
        # a change of gear leaves tens of rad/s: the coupling slips beyond a quarter of full torque
        most = 0.25 * self.truck.peak_torque
        driven = wheel_force(self.setting, view, np.clip(torque, -most, most)) * locked
        return -(driven + p.wheels_kg * np.clip(view.acceleration, -4.0, 4.0)) * moving(view)


@hidden(
    "play_is_crossed",
    name="driveline_backlash",
    forms="second",
    source="Nordin and Gutman, Controlling Mechanical Systems with Backlash, Automatica 38 (2002): the play"
    " is crossed by integrating the speed of the free side, then shafts wind up; angles of a worn heavy"
    " driveline, chosen here",
    ranges={"play_rad": (0.8, 2.2), "wind_up_s": (0.10, 0.35), "knock": (0.3, 0.9)},
    needs=("suburban", "hills"),
)
class PlayIsCrossed(Hidden):
    """Time without torque is the longer the gentler the torque turns; play_rad is at the flywheel."""

    def start(self, batch: int) -> dict[str, Array]:
        zero = np.zeros(batch)
        return {
            "side": np.ones(batch),
            "way": zero,
            "rate": zero.copy(),
            "share": np.ones(batch),
            "hit": zero.copy(),
        }

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        side = np.where(np.abs(view.traction_force) > 50.0, np.sign(view.traction_force), s.side)
        s.way = np.where(side != s.side, p.play_rad, s.way)
        s.side = side
        free = s.way > 0.0
        push = np.abs(view.engine_torque) / self.truck.engine_inertia
        s.rate = np.where(free, s.rate + dt * np.clip(push, 4.0, 150.0), 0.0)
        before = s.way
        s.way = np.maximum(s.way - dt * s.rate, 0.0)
        meets = (before > 0.0) & (s.way == 0.0)
        s.hit = np.where(meets, s.rate, s.hit * (1.0 - dt / 0.06))
        s.share = np.where(s.way > 0.0, 0.0, s.share + dt * (1.0 - s.share) / p.wind_up_s)
        knock = p.knock * self.truck.engine_inertia * s.hit * view.ratio / self.truck.wheel_radius / 0.06
        knock = np.minimum(knock, 0.06 * 9.81 * view.mass)
        return ((s.share - 1.0) * view.traction_force + s.side * knock * (s.way == 0.0)) * moving(view)
