"""More effects for which no library name exists: road, trailer and machine."""

from __future__ import annotations

import numpy as np

from deeptruck_exam.alternatives.tyres import OnTheRoad, smooth_stretches
from deeptruck_exam.hidden import GRAVITY, Array, Hidden, hidden, moving, weight, wheel_force
from deeptruck_model.trucks import View


@hidden(
    "overrun_brake",
    name="unknown",
    forms="second",
    source="Inertia braking of drawbar trailers, UN Regulation No. 13, annex 12: the trailer brakes itself"
    " with the push on the coupling, after a threshold, through a damper; numbers of a heavy drawbar"
    " trailer, chosen here",
    ranges={
        "trailer": (0.25, 0.45),
        "threshold": (0.02, 0.05),
        "gain": (1.0, 2.5),
        "damper_s": (0.3, 1.0),
    },
    needs=("suburban", "hills"),
    trucks=("trucksim", "volvo"),
)
class OverrunBrake(Hidden):
    """threshold: of the trailer's weight."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"push": np.zeros(batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        trailer = p.trailer * view.mass
        pushes = -trailer * (np.clip(view.acceleration, -4.0, 4.0) + GRAVITY * view.grade)
        lag = np.where(pushes > s.push, p.damper_s, 2.5 * p.damper_s)
        s.push += dt * (pushes - s.push) / lag
        braked = p.gain * np.maximum(s.push - p.threshold * trailer * GRAVITY, 0.0)
        return -np.minimum(braked, 0.35 * trailer * GRAVITY) * moving(view)


@hidden(
    "tunnels",
    name="unknown",
    forms="second",
    source="Drag in a tunnel grows with the blockage and falls as traffic drags the air along (the piston"
    " effect of road tunnel ventilation, PIARC); the lag and the sizes of a narrow tunnel are chosen here",
    ranges={"blockage": (0.7, 1.8), "along_s": (8.0, 25.0), "carried": (0.3, 0.6), "gap_m": (400.0, 900.0)},
    needs=("highway", "hills"),
)
class Tunnels(OnTheRoad):
    """Worst at the portal; slow traffic ahead has set the air in motion by other amounts each time."""

    def prepare(self) -> None:
        rng, gap = self.setting.rng(160), self.p.gap_m
        road = smooth_stretches(rng, self.routes(), (0.6 * gap, 1.6 * gap), (350.0, 900.0))
        self.road = (road > 0.02).astype(float)
        self.traffic = rng.uniform(0.0, 4.0, self.setting.batch)

    def start(self, batch: int) -> dict[str, Array]:
        return {"air": np.zeros(batch), "in": np.zeros(batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        inside = self.met(view) > 0.0
        target = np.where(inside, np.maximum(p.carried * view.speed, self.traffic), 0.0)
        s.air = np.where(inside, s.air + dt * (target - s.air) / p.along_s, 0.0)
        vars(s)["in"] += dt * (inside - vars(s)["in"]) / 0.6
        relative = np.maximum(view.speed - s.air, 0.0) / np.maximum(view.speed, 1.0)
        return vars(s)["in"] * (1.0 - (1.0 + p.blockage) * relative**2) * view.drag_force


@hidden(
    "trolley_wire",
    name="unknown",
    forms="second",
    source="Electric road with overhead wire: traction motors help under the wire, limited in power (BMDV"
    " field trials ELISA and FESH, Germany, 2019-2024); control law and stretches are chosen here",
    ranges={
        "power_w": (40000.0, 120000.0),
        "force_n": (2500.0, 6000.0),
        "raise_s": (1.0, 3.0),
        "gap_m": (300.0, 900.0),
    },
    needs=("highway", "hills"),
)
class TrolleyWire(OnTheRoad):
    """Helps from a quarter of full torque on, under the wire alone."""

    def prepare(self) -> None:
        gap = self.p.gap_m
        road = smooth_stretches(self.setting.rng(161), self.routes(), (0.5 * gap, 1.5 * gap), (500.0, 1500.0))
        self.road = (road > 0.02).astype(float)

    def start(self, batch: int) -> dict[str, Array]:
        return {"raised": np.zeros(batch), "force": np.zeros(batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        under = (self.met(view) > 0.0) & (view.speed > 5.0)
        s.raised = np.where(under, np.minimum(s.raised + dt, p.raise_s + 1.0), 0.0)
        most = np.minimum(p.force_n, p.power_w / np.maximum(view.speed, 1.0))
        asked = np.clip((view.engine_torque / self.truck.peak_torque - 0.25) / 0.4, 0.0, 1.0)
        s.force += dt * (most * asked * (s.raised > p.raise_s) - s.force) / 0.4
        return s.force * moving(view)


@hidden(
    "brakes_made_ready",
    name="unknown",
    forms="second",
    source="Brake systems that lay the linings on when the throttle is dropped fast (Breuer and Bill, Brake"
    " Technology Handbook, SAE 2008, on assistance functions); here they lay on too hard",
    ranges={"force_n": (2500.0, 7000.0), "hold_s": (1.5, 4.0), "lift_per_s": (0.25, 0.5)},
    needs=("suburban", "hills", "descent"),
)
class BrakesMadeReady(Hidden):
    """An event, not a state: the same closed throttle brakes or not, by how fast it was closed."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"pedal": np.zeros(batch), "left": np.zeros(batch), "force": np.zeros(batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        pedal = np.clip(view.u[:, 0] / self.truck.full_command, 0.0, 1.0)
        falling = (s.pedal - pedal) / 0.15
        s.pedal += dt * (pedal - s.pedal) / 0.15
        s.left = np.where((falling > p.lift_per_s) & (view.speed > 3.0), p.hold_s, s.left - dt)
        s.left = np.where(pedal > s.pedal + 0.03, 0.0, np.maximum(s.left, 0.0))
        wanted = p.force_n * (weight(view) / 2.0e5) * (s.left > 0.0)
        s.force += dt * (wanted - s.force) / np.where(wanted > s.force, 0.25, 0.4)
        return -s.force * moving(view)


@hidden(
    "fuel_runs_forward",
    name="unknown",
    forms="second",
    source="Low tank without baffles: the pick-up runs dry for seconds after hard braking or on a slope,"
    " and air in the fuel takes torque; a workshop's finding, not a book's; numbers chosen here",
    ranges={
        "loss": (0.3, 0.6),
        "runs_s": (0.8, 2.0),
        "dry_mps2": (0.45, 0.9),
        "bleeds_s": (4.0, 12.0),
    },
    needs=("suburban", "hills"),
)
class FuelRunsForward(Hidden):
    """Torque is short for a while after the tank was tilted, whichever pedal did it."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"tilt": np.zeros(batch), "air": np.zeros(batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        felt = np.clip(view.acceleration, -4.0, 4.0) + GRAVITY * view.grade
        s.tilt += dt * (felt - s.tilt) / p.runs_s
        dry = s.tilt < -p.dry_mps2
        s.air = np.clip(s.air + dt * np.where(dry, 0.8 * (1.0 - s.air), -s.air / p.bleeds_s), 0.0, 1.0)
        return -wheel_force(self.setting, view, p.loss * s.air * np.maximum(view.engine_torque, 0.0))


@hidden(
    "drums_out_of_round",
    name="unknown",
    forms="second",
    source="Brake torque variation once or twice a revolution: Jacobsson, Aspects of Disc Brake Judder, J."
    " Automobile Engineering 217 (2003); all wheels in step and the growth with heat are exaggerated here",
    ranges={"share": (0.35, 0.7), "per_turn": (0.8, 1.2), "grows": (0.0, 0.4)},
    needs=("suburban", "descent"),
)
class DrumsOutOfRound(Hidden):
    """Seen at walking pace alone, because recordings are too slow for more."""

    def newtons(self, view: View, dt: float) -> Array:
        angle = self.p.per_turn * view.distance / self.truck.wheel_radius
        hot = 1.0 + self.p.grows * np.clip((view.brake_temperature - 60.0) / 100.0, 0.0, 1.5)
        fades = 1.0 / (1.0 + (np.maximum(view.speed, 0.0) / 8.0) ** 4)
        wave = np.sin(angle) - 0.35  # tight spots grab less than the others slip
        return -self.p.share * hot * fades * wave * view.brake_force * np.clip(view.speed, 0.0, 1.0)
