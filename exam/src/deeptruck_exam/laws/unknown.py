"""Effects without a name in the tool's library: the right answer is 'unknown'."""

from __future__ import annotations

import numpy as np

from deeptruck_core.arrays import Array
from deeptruck_exam.laws.catalogue import law, sizes
from deeptruck_exam.laws.law import GRAVITY, Law, Sizes, State, index, moving, weight
from deeptruck_exam.laws.series import OnRoad, ou_series, smooth_spans
from deeptruck_model.trucks import View


@law("unknown", "highway", trucks="trucksim volvo")
@sizes(critical_mps=(17.0, 21.0), hz=(0.35, 0.6), drag_n=(2500.0, 6000.0))
class TrailerSway(Law, angle=0.05, rate=0.0):
    """A self-excited yaw oscillation of the trailer above a critical speed, with drag proportional to the
    angle squared.
    Source: Troger and Zeman, Vehicle System Dynamics 13 (1984); here as a van der Pol oscillator."""

    def prepare(self) -> None:
        self.kick = ou_series(
            self.rng(32), (self.setting.batch, int(self.setting.duration_s / 0.1) + 20), 0.1, 0.5
        )

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        omega = 2.0 * np.pi * p.hz
        growth = 0.12 * np.clip((view.speed - p.critical_mps) / 3.0, -2.0, 1.0)
        kick = 1.2 * self.kick[:, index(view, self.kick, 0.1)]
        s.rate += dt * (-(omega**2) * s.angle + 2.0 * omega * (growth - 0.25 * s.angle**2) * s.rate + kick)
        s.angle = np.clip(s.angle + dt * s.rate, -1.5, 1.5)
        return -p.drag_n * s.angle**2 * moving(view)


@law("unknown", "highway")
@sizes(low_drag=(0.30, 0.50), up_mps=(19.0, 22.0), hysteresis_mps=(3.0, 6.0), mean_s=(15.0, 40.0))
class BistableWake(Law):
    """The wake of a blunt body has two states with different drag; the difference is exaggerated.
    Source: Grandemange, Gohlke and Cadot, J. Fluid Mech. 722 (2013)."""

    def prepare(self) -> None:
        rng = self.rng(33)
        samples = int(self.setting.duration_s / 0.1) + 20
        self.flip = rng.random((self.setting.batch, samples)) < 0.1 / self.p.mean_s

    def start(self, batch: int) -> dict[str, Array]:
        return {"attached": np.zeros(batch), "seen": np.full(1, -1.0)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        at = index(view, self.flip, 0.1)
        if at != s.seen[0]:
            s.seen[0] = at
            s.attached = np.where(self.flip[:, at], 1.0 - s.attached, s.attached)
        s.attached = np.where(view.speed < p.up_mps - p.hysteresis_mps, 0.0, s.attached)
        return p.low_drag * s.attached * view.drag_force


@law("unknown", "highway hills")
@sizes(blockage=(0.7, 1.8), along_s=(8.0, 25.0), carried=(0.3, 0.6), gap_m=(400.0, 900.0))
class Tunnels(OnRoad):
    """Drag in a tunnel increases with the blockage, and decreases as traffic moves the air along.
    Source: PIARC, Road Tunnels: Vehicle Emissions and Air Demand for Ventilation, on the piston effect."""

    def prepare(self) -> None:
        rng, gap = self.rng(160), self.p.gap_m
        road = smooth_spans(rng, self.rows(), (0.6 * gap, 1.6 * gap), (350.0, 900.0))
        self.road = (road > 0.02).astype(float)
        self.traffic = rng.uniform(0.0, 4.0, self.setting.batch)

    def start(self, batch: int) -> dict[str, Array]:
        return {"air": np.zeros(batch), "in": np.zeros(batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        inside = self.here(view) > 0.0
        target = np.where(inside, np.maximum(p.carried * view.speed, self.traffic), 0.0)
        s.air = np.where(inside, s.air + dt * (target - s.air) / p.along_s, 0.0)
        vars(s)["in"] += dt * (inside - vars(s)["in"]) / 0.6
        relative = np.maximum(view.speed - s.air, 0.0) / np.maximum(view.speed, 1.0)
        return vars(s)["in"] * (1.0 - (1.0 + p.blockage) * relative**2) * view.drag_force


@law("unknown", "suburban hills", trucks="trucksim volvo")
@sizes(trailer=(0.25, 0.45), threshold=(0.02, 0.05), gain=(1.0, 2.5), damper_s=(0.3, 1.0))
class OverrunBrake(Law, push=0.0):
    """The trailer brakes itself by the force on the coupling, above a threshold and with a damper. threshold:
    share of the trailer's weight.
    Source: UN Regulation No. 13, annex 12, inertia braking."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        trailer = p.trailer * view.mass
        pushes = -trailer * (np.clip(view.acceleration, -4.0, 4.0) + GRAVITY * view.grade)
        lag = np.where(pushes > s.push, p.damper_s, 2.5 * p.damper_s)
        s.push += dt * (pushes - s.push) / lag
        braked = p.gain * np.maximum(s.push - p.threshold * trailer * GRAVITY, 0.0)
        return -np.minimum(braked, 0.35 * trailer * GRAVITY) * moving(view)


@law("unknown", "suburban")
@sizes(force_n=(900.0, 2600.0), critical_mps=(3.0, 7.0), below_mps=(10.0, 15.0))
class EddyRetarder(Law):
    """One stage of an eddy-current retarder remains energised below a road speed.
    Source: Wouterse, Critical Torque and Speed of Eddy Current Brake, IEE Proc. B 138 (1991): torque 2 /
    (v/vc + vc/v) about a critical speed."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        v = np.maximum(view.speed, 0.05)
        drag = 2.0 * p.force_n / (v / p.critical_mps + p.critical_mps / v)
        return -drag * (view.speed < p.below_mps) * moving(view)


@law("unknown", "suburban descent")
@sizes(loss=(0.45, 0.75), wipe_j=(0.25e6, 0.9e6), wetting_s=(10.0, 35.0))
class WetBrakes(Law, film=1.0):
    """Water reduces brake torque at first, and braking work removes it.
    Source: Newcomb and Spurr, Braking of Road Vehicles (1967), on wet brakes."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        lost = p.loss * s.film**0.7
        power = (1.0 - lost) * view.brake_force * view.speed
        rewet = (1.0 - s.film) * np.clip(view.speed / 10.0, 0.0, 1.5) / p.wetting_s * (power < 5e3)
        s.film = np.clip(s.film + dt * (rewet - power * s.film / p.wipe_j), 0.0, 1.0)
        return lost * view.brake_force * moving(view)


@law("unknown", "suburban")
@sizes(gain=(0.35, 0.8), speed_mps=(2.0, 5.0))
class StribeckBrake(Law):
    """Lining friction increases as sliding slows, so that braking is stronger in the last metres of a stop.
    Source: Rhee, SAE 740415, on the sensitivity of friction materials to speed."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        bite = p.gain * np.exp(-((np.maximum(view.speed, 0.0) / p.speed_mps) ** 1.3))
        return -bite * view.brake_force * np.clip(view.speed / 1.0, 0.0, 1.0)


@law("unknown", "hills highway descent")
@sizes(from_mps=(9.0, 14.0), share=(0.8, 1.0), after_s=(0.6, 1.6))
class EcoRoll(Law, closed=0.0):
    """The truck coasts in neutral at a closed throttle.
    Source: Hellström, Åslund and Nielsen, Design of an Efficient Algorithm for Fuel-Optimal Look-Ahead
    Control, Control Engineering Practice 18 (2010)."""

    withheld = ("gear", "engine_speed", "engine_torque")

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        closed = (view.u[:, 0] <= 0.01 * self.truck.full_command) & (view.u[:, 1] <= 0.01)
        s.closed = np.where(closed & (view.speed > p.from_mps), s.closed + dt, 0.0)
        rolling = np.clip((s.closed - p.after_s) / 0.5, 0.0, 1.0)
        return p.share * rolling * np.maximum(-view.traction_force, 0.0)


@law("unknown", "suburban", trucks="trucksim volvo")
@sizes(trailer_share=(0.2, 0.4), hz=(0.9, 1.8), damping=(0.06, 0.15), play_m=(0.002, 0.012))
class DrawbarSpring(Law, stretch=0.0, rate=0.0):
    """A trailer on a spring with free play, fore and aft.
    Source: Den Hartog, Mechanical Vibrations (1956): relative motion of two masses on a spring; free play as
    a dead zone."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        omega = 2.0 * np.pi * p.hz
        elastic = np.sign(s.stretch) * np.maximum(np.abs(s.stretch) - p.play_m, 0.0)
        turning = -(omega**2) * elastic - 2.0 * p.damping * omega * s.rate - view.acceleration
        s.rate += dt * turning
        s.stretch = np.clip(s.stretch + dt * s.rate, -0.4, 0.4)
        return -p.trailer_share * view.mass * np.clip(turning, -3.0, 3.0) * moving(view)


@law("unknown")
@sizes(compaction_n=(300.0, 1000.0), plough=(1.5, 5.0), deeper_per_min=(0.15, 0.45))
class Snow(Law):
    """Rolling resistance of snow with its depth, which increases as snow falls.
    Source: Shoop, Richmond and Lacombe, Overview of Cold Regions Mobility Modeling at CRREL, J.
    Terramechanics 43 (2006)."""

    def prepare(self) -> None:
        self.first = self.rng(31).uniform(0.0, 0.8, self.setting.batch)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        depth = self.first + p.deeper_per_min * view.time / 60.0
        wide = weight(view) / 2.0e5  # a heavier truck has more tyres in the snow
        force = p.compaction_n * depth**2 + p.plough * depth * view.speed**2
        return -wide * force * moving(view)


@law("unknown", "suburban hills")
@sizes(stiffness_n=(1.2e6, 2.5e6), tandem=(3.0, 8.0), sharpest=(0.015, 0.035))
class CurveResistance(Law):
    """Curve resistance with lateral force squared over cornering stiffness, and scrub of a tandem with
    curvature. sharpest: 1/m at walking pace; drivers keep lateral acceleration below 2.5 m/s2.
    Source: Mitschke and Wallentowitz, Dynamik der Kraftfahrzeuge (2014)."""

    def prepare(self) -> None:
        noise = ou_series(self.rng(30), (self.setting.batch, int(self.setting.duration_s) + 2), 1.0, 6.0)
        self.bend = np.maximum(np.abs(noise) - 0.7, 0.0)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        bend = self.bend[:, index(view, self.bend)]
        curvature = np.minimum(p.sharpest * bend, 2.5 / np.maximum(view.speed, 3.0) ** 2)
        lateral = view.mass * view.speed**2 * curvature
        scrub = p.tandem * 0.7 * weight(view) * curvature * 0.08
        return -(lateral**2 / p.stiffness_n + scrub) * moving(view)


@law("unknown")
@sizes(gain=(0.8, 1.8), leak_m=(900.0, 2500.0), puncture_share=(0.1, 0.5))
class SlowPuncture(Law):
    """A leak over distance; rolling loss rises with a power of pressure.
    Source: SAE J2452: rolling resistance as a power of inflation pressure."""

    def prepare(self) -> None:
        self.from_m = self.rng(34).uniform(0.0, 2.0, self.setting.batch) * 2500.0 * self.p.puncture_share

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        since = np.maximum(view.distance - self.from_m, 0.0)
        pressure = 0.12 + 0.88 * np.exp(-since / p.leak_m)
        growth = p.gain * (pressure**-0.6 - 1.0)
        return -growth * self.truck.rolling_resistance * weight(view) * moving(view)
