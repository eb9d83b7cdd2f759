"""Third forms between flywheel and wheel."""

from __future__ import annotations

import numpy as np

from deeptruck_exam.hidden import Array, Hidden, hidden, moving, weight, wheel_force
from deeptruck_model.trucks import View


@hidden(
    "standard_losses",
    name="driveline_loss",
    forms="third",
    source="Commission Regulation (EU) 2017/2400, annex VI (VECTO): torque loss at the input shaft as a"
    " constant, a part linear in its speed and a share of the torque carried; several times the standard"
    " values, as of worn bearings and wrong oil",
    ranges={"constant_nm": (20.0, 60.0), "per_1000rpm_nm": (25.0, 75.0), "share": (0.03, 0.08)},
    accepts=("torque_gain", "engine_friction"),  # drag before the gearbox is drag of the engine
)
class StandardLosses(Hidden):
    def newtons(self, view: View, dt: float) -> Array:
        p = self.p
        drag = p.constant_nm + p.per_1000rpm_nm * view.engine_speed / 104.7
        lost = wheel_force(self.setting, view, drag) + p.share * np.maximum(view.traction_force, 0.0)
        return -lost * moving(view)


@hidden(
    "dogs_miss",
    name="shift_interruption",
    forms="third",
    source="Dog clutches that meet tooth on tooth and are tried again (Naunheimer, Bertsche, Ryborz and"
    " Novak, Automotive Transmissions, 2011, on gear shifting mechanisms): most changes are quick, some"
    " are not, by chance; odds and times are chosen here",
    ranges={"odds": (0.45, 0.8), "again_s": (0.8, 2.2), "quick_s": (0.1, 0.35), "back_s": (0.25, 0.6)},
    needs=("suburban", "hills"),
)
class DogsMiss(Hidden):
    def prepare(self) -> None:
        rng, shape = self.setting.rng(220), (self.setting.batch, 600)
        missed = rng.random(shape) < self.p.odds
        self.wait = np.where(missed, self.p.again_s * rng.uniform(0.5, 1.3, shape), self.p.quick_s)

    def start(self, batch: int) -> dict[str, Array]:
        return {
            "gear": np.full(batch, -1.0),
            "changes": np.zeros(batch, int),
            "open": np.zeros(batch),
            "share": np.ones(batch),
        }

    def newtons(self, view: View, dt: float) -> Array:
        s = self.s
        changed = (s.gear >= 0.0) & (view.gear != s.gear)
        s.gear = view.gear.copy()
        s.changes = (s.changes + changed) % self.wait.shape[1]
        wait = self.wait[np.arange(len(changed)), s.changes]
        s.open = np.where(changed, wait, np.maximum(s.open - dt * (view.shifting == 0.0), 0.0))
        s.share = np.where(s.open > 0.0, 0.0, s.share + dt * (1.0 - s.share) / self.p.back_s)
        return -(1.0 - s.share) * np.maximum(view.traction_force, 0.0)


@hidden(
    "lockup_hunts",
    name="torque_converter_slip",
    forms="third",
    source="Lock-up clutches that open against judder (Naunheimer, Bertsche, Ryborz and Novak, Automotive"
    " Transmissions, 2011, on converter lock-up); efficiency of an open converter near coupling, one to two"
    " tenths lost; opening and closing by the clutch's heat is chosen here",
    ranges={"lost": (0.12, 0.25), "coast": (0.4, 0.8), "warms_s": (8.0, 20.0), "cools_s": (8.0, 20.0)},
    needs=("suburban", "hills", "highway"),
    trucks=("freightliner",),
    gateable=False,  # as the older forms of this name
    accepts=("driveline_loss",),
)
class LockupHunts(Hidden):
    """While open it takes a share of the pull, and most of the engine's drag when coasting."""

    conceal = ("engine_speed",)

    def start(self, batch: int) -> dict[str, Array]:
        first = self.setting.rng(221).uniform(0.0, 0.9, batch)
        return {"heat": first, "open": np.zeros(batch), "slips": np.zeros(batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        load = 0.5 + np.abs(view.engine_torque) / self.truck.peak_torque
        s.heat += dt * np.where(s.open > 0.5, -1.0 / p.cools_s, load / p.warms_s)
        s.open = np.where(s.heat > 1.0, 1.0, np.where(s.heat < 0.0, 0.0, s.open))
        s.slips += dt * (s.open * (view.speed > 4.0) - s.slips) / 0.3
        pull, push = np.maximum(view.traction_force, 0.0), np.maximum(-view.traction_force, 0.0)
        return s.slips * (p.coast * push - p.lost * pull) * moving(view)


@hidden(
    "freewheeling_rotor",
    name="rotating_inertia",
    forms="third",
    source="An inertia behind an overrunning clutch, as freewheels in Dubbel, Taschenbuch"
    " für den Maschinenbau (2018): it is driven up and runs on by itself; a heavy rotor on the propeller"
    " shaft, sizes chosen here",
    ranges={"share": (0.14, 0.28), "grips_s": (0.3, 0.9), "runs_s": (12.0, 40.0)},
    needs=("suburban", "hills"),
    accepts=("mass", "payload_change"),
)
class FreewheelingRotor(Hidden):
    """share: of the truck's mass, as if at the tread. Speeding up costs, slowing down gives nothing back."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"rotor": np.full(batch, -1.0)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        s.rotor = np.where(s.rotor < 0.0, view.speed, s.rotor)
        faster = np.maximum(view.speed - s.rotor, 0.0)
        most = 0.06 * weight(view)
        torque = np.minimum(p.share * view.mass * faster / p.grips_s, most)
        s.rotor = s.rotor + dt * (torque / (p.share * view.mass) - s.rotor / p.runs_s * (faster == 0.0))
        return -torque * moving(view)


@hidden(
    "two_masses_and_play",
    name="driveline_backlash",
    forms="third",
    source="Kiencke and Nielsen, Automotive Control Systems (2005), driveline as two masses with shafts and"
    " a dead zone: motion through the play and torsion of the shafts are integrated; after the play the"
    " engine gives torque back slowly, as controls do against the clonk (Lagerberg and Egardt, IEEE Trans."
    " Control Syst. Technol. 15, 2007); sizes of a worn driveline, chosen here",
    ranges={"play_rad": (0.9, 2.2), "hz": (1.0, 2.0), "damping": (0.04, 0.10), "gentle_s": (0.6, 1.6)},
    needs=("suburban", "hills"),
)
class TwoMassesAndPlay(Hidden):
    """play_rad at the flywheel; `way`, `rate` of the engine's mass against the wheels, m at the tread."""

    def start(self, batch: int) -> dict[str, Array]:
        return {
            "way": np.zeros(batch),
            "rate": np.zeros(batch),
            "ratio": np.zeros(batch),
            "given": np.ones(batch),
        }

    def newtons(self, view: View, dt: float) -> Array:
        p, s, truck = self.p, self.s, self.truck
        ratio = np.maximum(view.ratio, 1.0)
        inertia = truck.engine_inertia * (ratio / truck.wheel_radius) ** 2
        stiffness, play = inertia * (2.0 * np.pi * p.hz) ** 2, 0.5 * p.play_rad * truck.wheel_radius / ratio
        s.given = np.minimum(s.given + dt / p.gentle_s, 1.0)
        force = s.given * view.traction_force
        meshed = np.sign(force) * play + force / stiffness
        new = (np.abs(ratio - s.ratio) > 0.01) | (view.shifting > 0.0)  # a gear goes in without a jerk
        s.way, s.rate = np.where(new, meshed, s.way), np.where(new, 0.0, s.rate)
        s.ratio = ratio
        side, deep = np.sign(s.way), np.abs(s.way) - play
        s.given = np.where((deep < 0.0) & ~new, 0.15, s.given)
        twist = stiffness * side * deep + 4.0 * np.pi * p.hz * p.damping * inertia * s.rate
        shaft = np.where(deep > 0.0, side * np.maximum(side * twist, 0.0), 0.0)
        s.rate = s.rate + dt * (force - shaft) / inertia
        s.way = s.way + dt * s.rate
        most = 0.12 * weight(view)
        return np.clip(shaft - view.traction_force, -most, most) * moving(view)
