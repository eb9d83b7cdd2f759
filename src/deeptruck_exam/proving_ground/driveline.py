"""Seventh forms between flywheel and wheel."""

from __future__ import annotations

import numpy as np

from deeptruck_exam.hidden import Array, moving, weight, wheel_force
from deeptruck_exam.proving_ground.law import Law, law
from deeptruck_model.trucks import View


@law(
    "oil_is_flung_up",
    name="driveline_loss",
    source="Regulation (EU) 2017/2400, annexes VI and VII, loss maps of gearboxes and axles, and Niemann and"
    " Winter, Maschinenelemente, on churning: a full sump costs torque with speed, an empty one makes teeth"
    " rub more; gears fling the oil up and it comes back in its own time",
    # churns: of the weight, full sump at 15 m/s; rubs: of the pull, dry; flung_m: at 15 m/s
    ranges={"churns": (0.008, 0.018), "rubs": (0.05, 0.14), "flung_m": (250, 700), "returns_s": (12, 40)},
    accepts=("torque_gain",),
)
class OilIsFlungUp(Law, sump=1.0):
    """Slow driving and stops fill the sump; fast driving trades churning for rubbing."""

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        turns = np.clip(view.speed / 15.0, 0.0, 2.0)
        flung = s.sump * np.maximum(view.speed, 0.0) * turns / p.flung_m
        s.sump = np.clip(s.sump + dt * ((1.0 - s.sump) / p.returns_s - flung), 0.0, 1.0)
        churns = p.churns * s.sump * turns * weight(view)
        return -(churns + p.rubs * (1.0 - s.sump) * np.abs(view.traction_force)) * moving(view)


@law(
    "torque_back_by_a_ramp",
    name="shift_interruption",
    source="Shift quality on proving grounds (Naunheimer and others, Automotive Transmissions, 2011, on"
    " automated manual gearboxes): after a change torque comes back by so many newton metres a second, so"
    " that the more is asked the longer it takes; a downward change is matched longer",
    ranges={"ramp_per_s": (0.16, 0.4), "waits_s": (0.1, 0.5), "down_s": (0.3, 1.0)},
    needs=("suburban", "hills"),
)
class TorqueBackByARamp(Law, gear=0.0, wait=0.0, given=2.0):
    """`given` over peak torque: what the ramp has reached."""

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        changed = (view.gear != s.gear) & (s.gear > 0.0) & (view.speed > 1.0)
        wait = p.waits_s + p.down_s * (view.gear < s.gear)
        s.wait = np.where(changed, wait, np.maximum(s.wait - dt * (1.0 - view.shifting), 0.0))
        s.gear = view.gear.copy()
        rises = dt * p.ramp_per_s * (s.wait <= 0.0) * (1.0 - view.shifting)
        s.given = np.where(changed, 0.05, np.minimum(s.given + rises, 2.0))
        missing = np.maximum(view.engine_torque / self.truck.peak_torque - s.given, 0.0)
        return -wheel_force(self.setting, view, missing * self.truck.peak_torque) * moving(view)


@law(
    "converter_by_its_test_code",
    name="torque_converter_slip",
    gateable=False,
    source="SAE J643, Hydrodynamic Drive Test Code: the pump's torque with its speed squared, by capacity and"
    " torque ratio over the ratio of speeds; open after every change of gear and at low speed, while the"
    " simulator believes it locked",
    # stall_rads: at peak torque; open_s: after a change
    ranges={"stall_rads": (165.0, 215.0), "open_s": (3.5, 8.0), "below_mps": (6.0, 10.0)},
    needs=("suburban",),
    trucks=("freightliner",),
    accepts=("driveline_loss", "shift_interruption"),
)
class ConverterByItsTestCode(Law, pump=-1.0, gear=0.0, since=0.0):
    """`pump` rad/s; the turbine turns as the simulator has the engine."""

    conceal = ("engine_speed",)

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        turbine = np.maximum(view.engine_speed, 1.0)
        s.since = np.where(view.gear != s.gear, 0.0, s.since + dt)
        s.gear = view.gear.copy()
        is_open = (s.since < p.open_s) | (view.speed < p.below_mps)
        pump = np.where((s.pump < 0.0) | ~is_open, turbine, s.pump)
        over = np.clip(turbine / np.maximum(pump, 1.0), 0.0, 1.2)
        takes = self.truck.peak_torque * (pump / p.stall_rads) ** 2 * np.clip(1.0 - over**6, -0.5, 1.0)
        gives = takes * np.maximum(1.5 - (1.5 - 1.0) * over / 0.85, 1.0)
        s.pump = np.maximum(pump + dt * (view.engine_torque - takes) / 2.5, 50.0)
        felt = np.where(is_open, gives - view.engine_torque, 0.0)
        most = 0.8 * self.truck.peak_torque
        return wheel_force(self.setting, view, np.clip(felt, -most, most)) * np.clip(view.speed - 0.5, 0, 1)


@law(
    "flywheel_behind_an_induction_coupling",
    name="rotating_inertia",
    source="Rolls and flywheels coupled to axles on vehicle benches; an induction coupling's torque over slip"
    " after Kloss (Fitzgerald, Kingsley and Umans, Electric Machinery, on induction machines): it rises to"
    " the pull-out slip and falls beyond; a towed generator's flywheel",
    # share: of the mass, as it is felt at the road; most: of the weight, at the pull-out slip
    ranges={"share": (0.22, 0.42), "most": (0.018, 0.036), "slip_mps": (0.25, 0.9), "rubs_s": (60.0, 200.0)},
    needs=("suburban", "hills"),
    accepts=("mass", "payload_change"),
)
class FlywheelBehindAnInductionCoupling(Law, rim=-1.0):
    """`rim` m/s of the flywheel as at the road: gentle changes carry it along, hard ones leave it behind."""

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        s.rim = np.where(s.rim < 0.0, view.speed, s.rim)
        slip = (view.speed - s.rim) / p.slip_mps
        pulls = p.most * 2.0 * slip / (1.0 + slip**2) * weight(view) * (view.speed > 1.0)
        s.rim = np.maximum(s.rim + dt * (pulls / (p.share * view.mass) - s.rim / p.rubs_s), 0.0)
        return -pulls


@law(
    "clunk_and_shuffle",
    name="driveline_backlash",
    source="Tip-in and tip-out tests (clunk and shuffle: Rahnejat, ed., Tribology and Dynamics of Engine and"
    " Powertrain, 2010): torque that changes sides has to run through the lash first, the less torque the"
    " longer, and what the parts have gathered on the way swings out in the half-shafts",
    # lash_nms2: of the lash times the inertia ahead of it; swings: m/s2 for each second under way
    ranges={"lash_nms2": (60.0, 220.0), "hz": (1.4, 2.8), "damping": (0.06, 0.16), "swings": (0.4, 1.0)},
    needs=("suburban", "hills"),
)
class ClunkAndShuffle(Law, at=0.0, run=0.0, shake=0.0, pace=0.0):
    """`at` -1..1 through the lash; `shake` and `pace` of the swing, m/s2 and m/s3."""

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        torque = view.engine_torque * (1.0 - view.shifting)
        crosses = np.abs(s.at + np.sign(torque)) < 1.999
        s.run = np.where(crosses, s.run + dt * torque / p.lash_nms2, 0.0)
        step = np.clip(s.at + dt * s.run, -1.0, 1.0)
        hits = crosses & (np.abs(step) >= 1.0)
        omega = 2.0 * np.pi * p.hz
        kick = np.where(hits, p.swings * np.clip(s.run, -1.5, 1.5) * omega, 0.0)
        s.at = step
        s.pace = s.pace + kick - dt * (omega**2 * s.shake + 2.0 * p.damping * omega * s.pace)
        s.shake = s.shake + dt * s.pace
        lost = wheel_force(self.setting, view, torque) * crosses
        return (np.clip(s.shake, -1.5, 1.5) * view.mass - lost) * moving(view)
