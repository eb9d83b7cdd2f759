"""Fourth forms between flywheel and wheel."""

from __future__ import annotations

import numpy as np

from deeptruck_exam.hidden import Array, Hidden, hidden, moving, wheel_force
from deeptruck_model.trucks import View


@hidden(
    "palmgren_and_cold_sumps",
    name="driveline_loss",
    forms="fourth",
    source="Palmgren, Grundlagen der Wälzlagertechnik: friction of bearings as the power 2/3 of viscosity"
    " times speed and a part with the load; viscosity of 75W-90 falls tenfold as a sump warms by its own"
    " losses; too much oil of the wrong grade, sizes chosen here",
    ranges={
        "cold_n": (1000.0, 2200.0),  # of a 20 t truck at 20 m/s
        "thins": (1.8, 2.8),
        "load": (0.04, 0.09),
        "warms_j": (1.0e6, 3.5e6),
    },
    accepts=("torque_gain",),
)
class PalmgrenAndColdSumps(Hidden):
    """Some drives start with the sumps warm from the last."""

    def prepare(self) -> None:
        self.first = self.setting.rng(330).uniform(0.0, 0.6, self.setting.batch)

    def start(self, batch: int) -> dict[str, Array]:
        return {"warm": self.first.copy()}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        size, speed = np.clip(view.mass / 2.0e4, 0.5, 1.6), np.maximum(view.speed, 0.0)
        viscous = p.cold_n * size * np.exp(-p.thins * s.warm) * (speed / 20.0) ** (2.0 / 3.0)
        lost = viscous + p.load * np.abs(view.traction_force)
        s.warm += dt * (lost * speed / (p.warms_j * size) * (1.0 - s.warm) - s.warm / 1800.0)
        return -lost * moving(view)


@hidden(
    "shifts_short_of_air",
    name="shift_interruption",
    forms="fourth",
    source="Pneumatic shift cylinders of automated gearboxes fed by a small reservoir (service bulletins on"
    " slow shifts at low supply pressure): every change draws air, and the next is slower the sooner it"
    " comes; torque returns along a straight ramp; volumes and times are chosen here",
    ranges={
        "draws": (0.10, 0.20),  # of the reservoir
        "refills_s": (15.0, 40.0),
        "dwell_s": (0.15, 0.4),  # with full pressure
        "ramp_s": (0.5, 1.3),
    },
    needs=("suburban", "hills"),
)
class ShiftsShortOfAir(Hidden):
    def start(self, batch: int) -> dict[str, Array]:
        air = self.setting.rng(331).uniform(0.6, 1.0, batch)
        return {"gear": np.full(batch, -1.0), "air": air, "wait": np.zeros(batch), "share": np.ones(batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        changed = (s.gear >= 0.0) & (view.gear != s.gear)
        s.gear = view.gear.copy()
        s.air = np.clip(s.air + dt * (1.0 - s.air) / p.refills_s - p.draws * changed, 0.4, 1.0)
        s.wait = np.where(changed, p.dwell_s / s.air**2, np.maximum(s.wait - dt, 0.0))
        s.share = np.where(s.wait > 0.0, 0.0, np.minimum(s.share + dt / p.ramp_s, 1.0))
        return -(1.0 - s.share) * np.maximum(view.traction_force, 0.0)


@hidden(
    "no_lockup_in_cold_oil",
    name="torque_converter_slip",
    forms="fourth",
    source="Automatic gearboxes keep the converter open until the sump is warm (operator's manuals of heavy"
    " automatics on cold operation); slip of a fluid coupling in proportion to torque over speed squared"
    " (Föttinger's similarity; Naunheimer and others, Automotive Transmissions, 2011); sizes chosen here",
    ranges={"slip": (0.20, 0.38), "coast": (0.4, 0.8), "warms_j": (1.0e6, 3.0e6), "warms_s": (250.0, 500.0)},
    needs=("suburban", "hills", "highway"),
    trucks=("freightliner",),
    gateable=False,
    accepts=("driveline_loss",),
)
class NoLockupInColdOil(Hidden):
    """slip: at peak torque and 1200 rpm. It ends when the oil is warm, and the slip itself warms it."""

    conceal = ("engine_speed",)

    def start(self, batch: int) -> dict[str, Array]:
        return {"warm": self.setting.rng(332).uniform(-0.6, 0.5, batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        load = np.abs(view.engine_torque) / self.truck.peak_torque
        slip = np.clip(p.slip * load * (126.0 / np.maximum(view.engine_speed, 60.0)) ** 2, 0.03, 0.5)
        is_open = np.clip((1.0 - s.warm) / 0.05, 0.0, 1.0) * (view.speed > 3.0)
        pull, push = np.maximum(view.traction_force, 0.0), np.maximum(-view.traction_force, 0.0)
        lost = is_open * slip * pull
        s.warm = np.minimum(s.warm + dt * (lost * view.speed / p.warms_j + 1.0 / p.warms_s), 1.5)
        return (is_open * p.coast * push - lost) * moving(view)


@hidden(
    "blower_on_a_centrifugal_clutch",
    name="rotating_inertia",
    forms="fourth",
    source="Centrifugal clutches carry a torque that grows with speed squared above engagement (Shigley,"
    " Mechanical Engineering Design, on clutches); a blower's rotor on the power take-off is there above"
    " that speed and is not below; inertias and speeds are chosen here",
    ranges={"kgm2": (6.0, 13.0), "from_rads": (85.0, 112.0), "capacity_nm": (250.0, 700.0)},
    needs=("suburban", "hills"),
    accepts=("mass", "payload_change"),
)
class BlowerOnACentrifugalClutch(Hidden):
    """capacity_nm: at 1.4 times the speed of engagement. A rotor that was left behind has to be caught up."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"rotor": np.full(batch, -1.0)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        w = view.engine_speed
        s.rotor = np.where(s.rotor < 0.0, w, s.rotor)
        most = p.capacity_nm * np.clip((np.maximum(w, s.rotor) / p.from_rads) ** 2 - 1.0, 0.0, 1.5)
        torque = np.clip(p.kgm2 * (w - s.rotor) / 0.12, -most, most) * (1.0 - view.shifting)
        s.rotor = s.rotor + dt * (torque / p.kgm2 - s.rotor / 45.0)
        return -wheel_force(self.setting, view, torque) * (view.speed > 1.5)


@hidden(
    "four_plays_in_a_row",
    name="driveline_backlash",
    forms="fourth",
    source="Free play adds up over gearbox, joints, axle and hubs (truck service manuals measure each at the"
    " yokes), and is taken up one after the other while the control unit feeds torque carefully (Lagerberg,"
    " Control and Estimation of Automotive Powertrains with Backlash, Chalmers, 2004): torque comes back in"
    " a staircase; times of a worn driveline, chosen here",
    ranges={"each_s": (0.15, 0.40), "held": (0.0, 0.25), "ramp_s": (0.2, 0.7)},
    needs=("suburban", "hills"),
)
class FourPlaysInARow(Hidden):
    """held: of the torque, fed while a play is open."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"side": np.ones(batch), "taken": np.full(batch, 4.0), "share": np.ones(batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        pull = view.traction_force
        side = np.where(np.abs(pull) > 150.0, np.sign(pull), s.side)
        s.taken = np.where(side != s.side, 0.0, s.taken)
        s.share = np.where(side != s.side, p.held, s.share)
        s.side = side
        pushes = np.abs(view.engine_torque)
        pace = (pushes + 60.0) / (pushes + 240.0)  # a gentle torque crosses slowly
        s.taken = np.minimum(s.taken + dt * pace / p.each_s, 4.0)
        step = np.maximum(np.floor(s.taken) / 4.0, p.held)
        s.share = np.minimum(s.share + dt / p.ramp_s, step)
        return -(1.0 - s.share) * pull * moving(view)
