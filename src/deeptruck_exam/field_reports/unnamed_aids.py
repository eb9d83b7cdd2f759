"""Fourth effects for which no library name exists: trailers that brake, steer and are pushed."""

from __future__ import annotations

import numpy as np

from deeptruck_exam.hidden import Array, Hidden, hidden, moving, weight
from deeptruck_model.trucks import View


@hidden(
    "stretch_brake",
    name="unknown",
    forms="fourth",
    source="Stretch brakes (truck makers' driver guides): while the throttle is closed at low speed the"
    " trailer's brakes are pulsed, to keep the train straight; pulses and depth are chosen here",
    ranges={"depth": (0.022, 0.050), "period_s": (2.0, 4.5), "duty": (0.3, 0.5), "below_mps": (11.0, 14.0)},
    needs=("suburban", "descent"),
    trucks=("trucksim", "volvo"),
)
class StretchBrake(Hidden):
    """depth: over weight. No pedal is pressed, and no brake command is recorded."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"closed": np.zeros(batch), "force": np.zeros(batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        closed = (view.u[:, 0] <= 0.01 * self.truck.full_command) & (view.speed > 1.5)
        s.closed = np.where(closed & (view.speed < p.below_mps), s.closed + dt, 0.0)
        within = (s.closed - 0.5) / p.period_s
        pulse = (s.closed > 0.5) & (within - np.floor(within) < p.duty)
        s.force += dt * (p.depth * weight(view) * pulse - s.force) / np.where(pulse, 0.2, 0.3)
        return -s.force * moving(view)


@hidden(
    "timed_trailer_brakes",
    name="unknown",
    forms="fourth",
    source="Time-delayed controllers of electric trailer brakes (suppliers' installation guides; SAE J2663"
    " on electric brakes): the stop-lamp switch starts a ramp to a dialled level, however gently the driver"
    " brakes; ramps and levels are chosen here",
    ranges={"level": (0.025, 0.055), "ramp_s": (1.5, 4.0), "lets_go_s": (0.2, 0.8)},
    needs=("suburban", "descent"),
)
class TimedTrailerBrakes(Hidden):
    """level: over weight; magnets grip less as the wheels slow down."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"current": np.zeros(batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        lamp = view.u[:, 1] > 0.02
        rate = np.where(lamp, 1.0 / p.ramp_s, -1.0 / p.lets_go_s)
        s.current = np.clip(s.current + dt * rate, 0.0, 1.0)
        grips = np.clip(np.maximum(view.speed, 0.0) / 5.0, 0.0, 1.0) ** 0.5
        return -p.level * s.current * grips * weight(view) * moving(view)


@hidden(
    "pushed_by_a_second_tractor",
    name="unknown",
    forms="fourth",
    source="Heavy haulage with a pusher (Specialized Carriers and Rigging Association guides; police permits"
    " for heavy loads): its driver helps when the train falls behind the pace of the last half minute, told"
    " by radio some seconds late, and eases off once it is back; gains are chosen here",
    ranges={"per_mps": (0.012, 0.03), "most": (0.03, 0.06), "late_s": (1.5, 4.0), "pace_s": (20.0, 45.0)},
    needs=("hills", "highway"),
)
class PushedByASecondTractor(Hidden):
    """per_mps, most: over weight. A truck that slows by its own brakes is not pushed."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"pace": np.full(batch, -1.0), "heard": np.zeros(batch), "force": np.zeros(batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        s.pace = np.where(s.pace < 0.0, view.speed, s.pace)
        s.pace += dt * (view.speed - s.pace) / np.where(view.speed > s.pace, 4.0, p.pace_s)
        behind = np.maximum(s.pace - view.speed - 0.5, 0.0) * (view.u[:, 1] <= 0.02)
        s.heard += dt * (behind - s.heard) / p.late_s
        wanted = np.minimum(p.per_mps * s.heard, p.most) * weight(view)
        s.force += dt * (wanted - s.force) / np.where(wanted > s.force, 1.2, 0.5)
        return s.force * (view.u[:, 1] <= 0.02) * np.clip(view.speed / 2.0, 0.0, 1.0)


@hidden(
    "misaligned_lift_axle",
    name="unknown",
    forms="fourth",
    source="Axles out of square drag by side force times toe (TMC RP 642 on total vehicle alignment; linear"
    " cornering stiffness, Pacejka, Tyre and Vehicle Dynamics, 2012); a lift axle that is lowered at road"
    " speed and raised by the traction aid when much is asked; toe and stiffness are chosen here",
    ranges={
        "toe_deg": (1.6, 2.8),
        "stiffness": (7.0, 12.0),  # 1/rad, of its load
        "share": (0.50, 0.75),  # of the weight, on the group with the lift axle
        "down_mps": (5.0, 9.0),
        "up_load": (0.34, 0.55),
    },
    needs=("suburban", "hills", "highway"),
)
class MisalignedLiftAxle(Hidden):
    """While it is up the truck rolls freely."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"asked": np.zeros(batch), "up": np.zeros(batch), "height": np.zeros(batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        load = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.1)
        s.asked += dt * (load - s.asked) / 1.5
        lower = (s.asked < 0.45 * p.up_load) & (view.speed > p.down_mps)
        s.up = np.where(s.asked > p.up_load, 1.0, np.where(lower, 0.0, s.up))
        s.height += np.clip(s.up - s.height, -dt / 6.0, dt / 3.0)
        toe = np.deg2rad(p.toe_deg)
        drag = min(p.stiffness * toe, 0.6) * np.sin(toe) * p.share * weight(view)
        return -drag * (1.0 - np.clip(1.6 * s.height, 0.0, 1.0)) * moving(view)
