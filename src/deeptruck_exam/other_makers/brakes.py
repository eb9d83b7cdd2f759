"""Third forms in the brakes: heat that soaks in, long pipes, pads that do not retract, a held speed."""

from __future__ import annotations

import numpy as np

from deeptruck_exam.hidden import Array, Hidden, hidden, moving, wheel_force
from deeptruck_model.trucks import View


@hidden(
    "soaking_heat",
    name="brake_fade",
    forms="third",
    source="Carslaw and Jaeger, Conduction of Heat in Solids (1959): the surface of a half-space heats by"
    " the half integral of its heat flow; friction falls in a straight line above an onset (Day, Braking of"
    " Road Vehicles, 2014, on fade); the share of brakes that carry the load is chosen here",
    ranges={
        "effusivity": (3000.0, 6500.0),  # W s^0.5/K, of all rubbing surfaces of a 20 t truck
        "onset_k": (25.0, 60.0),
        "per_k": (0.0028, 0.0055),
    },
    needs=("descent",),
)
class SoakingHeat(Hidden):
    """Warms with the root of time and cools as slowly; no mass has one temperature."""

    def prepare(self) -> None:
        self.rate = 4.0 ** -np.arange(5.0)[:, None]  # 1/s
        # 1/sqrt(pi t) as a sum of exponentials, four to one apart
        self.part = np.log(4.0) / np.pi * np.sqrt(self.rate)
        self.area = self.p.effusivity * self.truck.mass / 2.0e4

    def start(self, batch: int) -> dict[str, Array]:
        return {"soaked": np.zeros((5, batch))}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        above = (self.part * s.soaked).sum(axis=0) - p.onset_k
        lost = np.clip(p.per_k * above, 0.0, 0.65)
        flow = (1.0 - lost) * view.brake_force * np.maximum(view.speed, 0.0) / self.area
        s.soaked += dt * (flow - self.rate * s.soaked)
        return lost * view.brake_force * moving(view)


@hidden(
    "long_pipes",
    name="brake_lag",
    forms="third",
    source="Response times of trailing axles, UN Regulation No. 13, annex 6, and Limpert, Brake Design and"
    " Safety, on pneumatic lines; three lumps of a pipe in a row that empty slower than they fill, numbers"
    " of a train without electronic control chosen here",
    ranges={"share": (0.5, 0.85), "lump_s": (0.22, 0.5), "slower_out": (1.2, 2.2)},
    needs=("suburban", "descent"),
    accepts=("command_delay", "clock_offset"),
)
class LongPipes(Hidden):
    """Linear: small changes come as late as large ones."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"lumps": np.zeros((3, batch))}

    def newtons(self, view: View, dt: float) -> Array:
        p, lumps = self.p, self.s.lumps
        before = np.concatenate([view.brake_force[None], lumps[:-1]])
        slower = np.where(before < lumps, p.slower_out, 1.0)
        lumps += dt * (before - lumps) / (p.lump_s * slower)
        return p.share * (view.brake_force - lumps[-1]) * moving(view)


@hidden(
    "pads_stay_on",
    name="dragging_brake",
    forms="third",
    source="Breuer and Bill, Brake Technology Handbook (SAE, 2008), on residual torque of disc brakes:"
    " nothing but disc run-out pushes the pads back, so that drag follows the last application and dies"
    " with the way; seized guide pins, sizes chosen here",
    ranges={"kept": (0.10, 0.28), "way_m": (250.0, 1100.0), "most": (0.012, 0.03)},
    needs=("suburban", "descent"),
)
class PadsStayOn(Hidden):
    """most: of the truck's weight."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"held": np.zeros(batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        pressed = np.minimum(p.kept * view.brake_force, p.most * 9.81 * view.mass)
        rolled = dt * np.maximum(view.speed, 0.0) / p.way_m
        s.held = np.maximum(s.held * (1.0 - rolled), pressed)
        return -np.maximum(s.held - view.brake_force, 0.0) * moving(view)


@hidden(
    "speed_held_downhill",
    name="engine_brake",
    forms="third",
    source="Auxiliary brakes that keep the speed at which the throttle was left (Automotive Handbook, Bosch,"
    " on retarders): proportional to the excess, limited by a torque in proportion to engine speed; gain"
    " and sizes are chosen here",
    ranges={
        "torque_nm": (350.0, 900.0),  # at 1800 rpm
        "band_mps": (0.6, 2.0),
        "below_mps": (0.2, 1.0),
        "lag_s": (0.3, 1.0),
    },
    needs=("descent", "hills"),
    accepts=("engine_friction",),
)
class SpeedHeldDownhill(Hidden):
    """The faster above the kept speed the harder, and nothing where the truck slows by itself."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"kept": np.full(batch, -1.0), "torque": np.zeros(batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        closed = (view.u[:, 0] <= 0.01 * self.truck.full_command) & (view.speed > 5.0)
        just = closed & (s.kept < 0.0)
        s.kept = np.where(just, view.speed - p.below_mps, np.where(closed, s.kept, -1.0))
        share = np.clip((view.speed - s.kept) / p.band_mps, 0.0, 1.0) * closed
        s.torque += dt * (share * p.torque_nm * view.engine_speed / 188.5 - s.torque) / p.lag_s
        return -wheel_force(self.setting, view, s.torque) * moving(view)
