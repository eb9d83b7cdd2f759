"""Sixth forms between flywheel and wheel."""

from __future__ import annotations

import numpy as np

from deeptruck_exam.hidden import Array, Hidden, hidden, moving, weight, wheel_force
from deeptruck_model.trucks import View


@hidden(
    "joint_at_an_angle",
    name="driveline_loss",
    forms="sixth",
    source="Universal Joint and Driveshaft Design Manual (SAE Advances in Engineering 7): a joint's friction"
    " grows with torque and angle, and the axle's nose turns up under torque until the levelling of the air"
    " springs has made up for it; dry needles, sizes are chosen here",
    ranges={
        "friction": (0.05, 0.09),  # of the pull, at the angle at rest
        "winds": (2.0, 6.0),  # of the angle at rest, by a pull of a tenth of the weight
        "levels_s": (10.0, 35.0),
        "hangs": (0.15, 0.4),  # of the angle, by what the springs do not level
    },
    accepts=("torque_gain",),
)
class JointAtAnAngle(Hidden):
    """Pulling bends the joint, coasting straightens it; after a long climb it is as at rest."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"levelled": np.zeros(batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        turned = p.winds * np.clip(10.0 * view.traction_force / weight(view), -1.0, 2.0)
        s.levelled += dt * ((1.0 - p.hangs) * turned - s.levelled) / p.levels_s
        angle = np.clip(np.abs(1.0 + turned - s.levelled), 0.0, 4.0)
        return -np.minimum(p.friction * angle, 0.35) * np.abs(view.traction_force) * moving(view)


@hidden(
    "foot_after_the_lever",
    name="shift_interruption",
    forms="sixth",
    source="People who change gears by hand come back to the pedal late and softly, no two times alike (AAMVA"
    " Commercial Driver License Manual, on shifting gears; log-normal response times: Luce, Response Times,"
    " 1986), and hurry uphill; torque returns as a bell's flank; times are chosen here",
    ranges={
        "hand_s": (0.2, 0.6),
        "foot_s": (0.5, 1.1),
        "spread": (0.3, 0.6),
        "hurries": (5.0, 20.0),  # faster, for each unit of slope
    },
    needs=("suburban", "hills"),
)
class FootAfterTheLever(Hidden):
    """The simulator knows the lever, not the foot."""

    def prepare(self) -> None:
        dice = self.setting.rng(512).standard_normal((self.setting.batch, 256))
        self.habit = np.exp(self.p.spread * np.clip(dice, -2.0, 2.0))

    def start(self, batch: int) -> dict[str, Array]:
        return {"gear": np.zeros(batch), "since": np.full(batch, 1e3), "count": np.zeros(batch, int)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        changed = (view.gear != s.gear) & (s.gear > 0.0) & (view.speed > 1.0)
        s.count = (s.count + changed) % 256
        s.since = np.where(changed, 0.0, s.since + dt * (1.0 - view.shifting))
        s.gear = view.gear.copy()
        pace = self.habit[np.arange(len(s.count)), s.count] / (1.0 + p.hurries * np.maximum(view.grade, 0.0))
        back = np.maximum(s.since - p.hand_s * pace, 0.0) / (p.foot_s * pace)
        return -np.exp(-(back**2)) * np.maximum(view.traction_force, 0.0) * moving(view)


@hidden(
    "drains_while_standing",
    name="torque_converter_slip",
    forms="sixth",
    gateable=False,
    source="Converters whose check valve leaks drain into the sump while the truck stands and fill again by"
    " the charge pump, which the engine turns (workshop manuals of heavy automatics on drain-back; fill of a"
    " coupling sets its torque: Naunheimer and others, Automotive Transmissions, 2011); sizes chosen here",
    ranges={"slips": (0.35, 0.6), "drains_s": (3.0, 9.0), "fills_s": (5.0, 14.0), "needs_fill": (0.7, 0.95)},
    needs=("suburban",),
    trucks=("freightliner",),
    accepts=("driveline_loss", "shift_interruption"),
)
class DrainsWhileStanding(Hidden):
    """slips: of the torque, with an empty one; none once it is filled to `needs_fill`."""

    conceal = ("engine_speed",)

    def start(self, batch: int) -> dict[str, Array]:
        return {"fill": self.setting.rng(513).uniform(0.0, 0.5, batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        pumps = np.clip(view.engine_speed / 120.0, 0.4, 1.6) / p.fills_s
        s.fill += dt * np.where(view.speed < 0.3, -s.fill / p.drains_s, pumps * (1.0 - s.fill))
        empty = np.clip(1.0 - s.fill / p.needs_fill, 0.0, 1.0)
        lost = p.slips * np.sqrt(empty) * np.maximum(view.engine_torque, 0.0)
        return -wheel_force(self.setting, view, lost) * moving(view)


@hidden(
    "rotor_behind_a_coupling",
    name="rotating_inertia",
    forms="sixth",
    source="A heavy rotor behind a hydrodynamic coupling on the power take-off: its torque goes with the"
    " difference of the squares of both speeds (Föttinger's similarity; Dubbel, Taschenbuch für den"
    " Maschinenbau, on hydrodynamic couplings); chippers and blowers, sizes are chosen here",
    ranges={"kgm2": (7.0, 13.0), "coupling_nm": (700.0, 1900.0), "windage_nm": (5.0, 25.0)},
    needs=("suburban", "hills"),
    accepts=("mass", "payload_change"),
)
class RotorBehindACoupling(Hidden):
    """Both at 150 rad/s apart from rest: the faster the engine, the firmer the coupling."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"rotor": np.full(batch, -1.0)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        s.rotor = np.where(s.rotor < 0.0, view.engine_speed, s.rotor)
        torque = p.coupling_nm * (view.engine_speed**2 - s.rotor**2) / 150.0**2
        holds = p.windage_nm * (s.rotor / 150.0) ** 2
        s.rotor = np.maximum(s.rotor + dt * (torque - holds) / p.kgm2, 0.0)
        return -wheel_force(self.setting, view, torque) * (view.speed > 1.5)


@hidden(
    "worn_clutch_damper",
    name="driveline_backlash",
    forms="sixth",
    source="Clutch dampers have a free angle, a soft stage for idling and a hard one (Shaver, Manual"
    " Transmission Clutch Systems, SAE Advances in Engineering 17): with worn windows the disc has to turn"
    " through all of them, against friction, before torque has changed sides; angles are chosen here",
    ranges={
        "free_rad": (0.10, 0.28),
        "soft_rad": (0.10, 0.25),
        "soft_nm": (900.0, 2200.0),  # for each rad
        "friction_nms": (550.0, 1300.0),
    },
    needs=("suburban", "hills"),
)
class WornClutchDamper(Hidden):
    """`turn` rad of the disc in its hub; what the springs hold reaches the wheels."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"turn": np.zeros(batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        beyond = np.maximum(np.abs(s.turn) - p.free_rad, 0.0)
        soft = p.soft_nm * np.minimum(beyond, p.soft_rad)
        held = np.sign(s.turn) * (soft + 14000.0 * np.maximum(beyond - p.soft_rad, 0.0))
        away = view.engine_torque - held
        s.turn = s.turn + dt * away / np.maximum(p.friction_nms, 14000.0 * dt)
        return -wheel_force(self.setting, view, away) * moving(view)
