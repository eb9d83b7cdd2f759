"""More effects for which no library name exists: machine parts the simulator's makers did not think of."""

from __future__ import annotations

import numpy as np

from deeptruck_exam.hidden import Array, Hidden, hidden, moving, weight, wheel_force
from deeptruck_model.trucks import View


@hidden(
    "eddy_retarder_left_on",
    name="unknown",
    source="Smythe (1942) and Wouterse, IEE Proc. B 138 (1991): eddy-current torque 2/(v/vc + vc/v) about a"
    " critical speed;"
    " one stage is left energised below a road speed",
    ranges={"force_n": (900.0, 2600.0), "critical_mps": (3.0, 7.0), "below_mps": (10.0, 15.0)},
    needs=("suburban",),
)
class EddyRetarder(Hidden):
    def newtons(self, view: View, dt: float) -> Array:
        v = np.maximum(view.speed, 0.05)
        drag = 2.0 * self.p.force_n / (v / self.p.critical_mps + self.p.critical_mps / v)
        return -drag * (view.speed < self.p.below_mps) * moving(view)


@hidden(
    "retarder_cold_oil",
    name="unknown",
    source="Idling fluid coupling: drag with a power of speed; the filling and emptying with oil"
    " temperature is chosen here",
    ranges={"drag_n": (900.0, 2400.0), "empties_k": (20.0, 45.0)},
    needs=("highway", "hills"),
)
class FillingRetarder(Hidden):
    """Fills above 12 m/s, heats, empties with hysteresis."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"oil": np.zeros(batch), "filled": np.ones(batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        drag = s.filled * p.drag_n * np.maximum(view.speed / 20.0, 0.0) ** 1.7
        s.oil += dt * (drag * view.speed / 3.0e4 - s.oil / 40.0)
        s.filled = np.where(s.oil > p.empties_k, 0.0, np.where(s.oil < 0.4 * p.empties_k, 1.0, s.filled))
        return -drag * moving(view)


@hidden(
    "hybrid_axle",
    name="unknown",
    source="Electric trailer axle: helps while the driver asks for much, harvests in coasting, until its"
    " battery is empty or full; control law chosen here",
    ranges={"power_w": (60000.0, 130000.0), "force_n": (3500.0, 8000.0), "energy_j": (0.8e6, 2.5e6)},
    needs=("suburban", "hills"),
    trucks=("trucksim", "volvo"),
)
class TrailerAxle(Hidden):
    def start(self, batch: int) -> dict[str, Array]:
        return {"charge": np.full(batch, 0.5), "force": np.zeros(batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        share = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.0)
        most = np.minimum(p.force_n, p.power_w / np.maximum(view.speed, 1.0))
        helping = most * np.clip((share - 0.45) / 0.2, 0.0, 1.0) * (s.charge > 0.02)
        coasting = (view.u[:, 0] <= 0.01 * self.truck.full_command) & (view.speed > 4.0) & (s.charge < 0.98)
        wanted = np.where(coasting, -0.35 * most, helping)
        s.force += dt * (wanted - s.force) / 0.25
        s.charge = np.clip(s.charge - dt * s.force * view.speed / p.energy_j, 0.0, 1.0)
        return s.force * moving(view)


@hidden(
    "torsional_band_loss",
    name="unknown",
    source="Driveline resonance in a band of engine speeds (Kiencke and Nielsen, Automotive Control"
    " Systems, 2005, on torsional drivelines); the torque lost in the band is chosen here",
    ranges={"centre_rpm": (1150.0, 1500.0), "width_rpm": (60.0, 140.0), "loss": (0.18, 0.40)},
    needs=("suburban", "highway", "hills"),
)
class ResonanceBand(Hidden):
    def newtons(self, view: View, dt: float) -> Array:
        rpm = view.engine_speed * 30.0 / np.pi
        near = 1.0 / (1.0 + ((rpm - self.p.centre_rpm) / self.p.width_rpm) ** 4)
        lost = self.p.loss * near * (np.abs(view.engine_torque) + 80.0)
        return -wheel_force(self.setting, view, lost) * moving(view)


@hidden(
    "eco_roll",
    name="unknown",
    source="Neutral coasting at a closed throttle, as look-ahead controls exploit it (Hellström, Åslund and"
    " Nielsen, Control Engineering Practice 18, 2010); thresholds are chosen here",
    ranges={"from_mps": (9.0, 14.0), "share": (0.8, 1.0), "after_s": (0.6, 1.6)},
    needs=("hills", "highway", "descent"),
)
class EcoRoll(Hidden):
    conceal = ("gear", "engine_speed", "engine_torque")

    def start(self, batch: int) -> dict[str, Array]:
        return {"closed": np.zeros(batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        closed = (view.u[:, 0] <= 0.01 * self.truck.full_command) & (view.u[:, 1] <= 0.01)
        s.closed = np.where(closed & (view.speed > p.from_mps), s.closed + dt, 0.0)
        rolling = np.clip((s.closed - p.after_s) / 0.5, 0.0, 1.0)
        return p.share * rolling * np.maximum(-view.traction_force, 0.0)


@hidden(
    "brake_bites_slow",
    name="unknown",
    source="Rhee, SAE 740415: lining friction depends on sliding speed, so the last metres of a stop bite"
    " harder; a Stribeck shape is chosen here",
    ranges={"gain": (0.35, 0.8), "speed_mps": (2.0, 5.0)},
    needs=("suburban",),
)
class StribeckBrake(Hidden):
    def newtons(self, view: View, dt: float) -> Array:
        bite = self.p.gain * np.exp(-((np.maximum(view.speed, 0.0) / self.p.speed_mps) ** 1.3))
        return -bite * view.brake_force * np.clip(view.speed / 1.0, 0.0, 1.0)


@hidden(
    "wet_brakes",
    name="unknown",
    source="Newcomb and Spurr, Braking of Road Vehicles (1967), treat wet brakes: water takes torque at"
    " first and braking work wipes it off; rates are chosen here",
    ranges={"loss": (0.45, 0.75), "wipe_j": (0.25e6, 0.9e6), "wetting_s": (10.0, 35.0)},
    needs=("suburban", "descent"),
)
class WetBrakes(Hidden):
    def start(self, batch: int) -> dict[str, Array]:
        return {"film": np.ones(batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        lost = p.loss * s.film**0.7
        power = (1.0 - lost) * view.brake_force * view.speed
        rewet = (1.0 - s.film) * np.clip(view.speed / 10.0, 0.0, 1.5) / p.wetting_s * (power < 5e3)
        s.film = np.clip(s.film + dt * (rewet - power * s.film / p.wipe_j), 0.0, 1.0)
        return lost * view.brake_force * moving(view)


@hidden(
    "engine_surge",
    name="unknown",
    source="Slow torque oscillation of a part-load engine; Heywood, Internal Combustion Engine"
    " Fundamentals, ch. 9, on cyclic variation; window and frequency are chosen here",
    ranges={"share": (0.25, 0.5), "hz": (0.25, 0.6), "low": (0.15, 0.3), "high": (0.55, 0.8)},
    needs=("highway", "hills", "suburban"),
)
class Surge(Hidden):
    def start(self, batch: int) -> dict[str, Array]:
        return {"phase": self.setting.rng(35).uniform(0.0, 6.28, batch), "size": np.zeros(batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        load = view.engine_torque / self.truck.peak_torque
        s.size += dt * (((load > p.low) & (load < p.high)) - s.size) / 1.0
        s.phase += dt * 2.0 * np.pi * p.hz * (0.8 + 0.4 * view.engine_speed / 140.0)
        swing = 0.5 * p.share * s.size * (np.sin(s.phase) - 1.0)
        return wheel_force(self.setting, view, swing * np.maximum(view.engine_torque, 0.0))


@hidden(
    "stepping_suspension_lock",
    name="unknown",
    source="Dahl, A Solid Friction Model, Aerospace Corp. TOR-0158 (1968), in a locked bushing: the force"
    " depends on the history of acceleration, not on its value",
    ranges={"yield_n": (900.0, 2600.0), "stiffness": (0.8, 3.0)},
    needs=("suburban", "hills"),
)
class DahlBushing(Hidden):
    """stiffness: of yield force per m/s of speed change."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"held": np.zeros(batch)}

    def newtons(self, view: View, dt: float) -> Array:
        s, limit = self.s, self.p.yield_n * weight(view) / 2.0e5
        rate = view.acceleration * self.p.stiffness
        s.held += dt * rate * (1.0 - np.sign(rate) * s.held)
        s.held = np.clip(s.held, -1.0, 1.0)
        return -limit * s.held * moving(view)
