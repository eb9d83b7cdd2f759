"""Hidden effects in the foundation brakes and the engine brake."""

from __future__ import annotations

import numpy as np

from deeptruck_exam.hidden import Array, Hidden, hidden, moving, wheel_force
from deeptruck_model.trucks import View


@hidden(
    "brake_fade",
    source="Two thermal masses (rubbing surface, drum body) as in Limpert, Brake Design and Safety, and"
    " Day, Braking of Road Vehicles (2014); the S-shaped friction curve and its numbers are chosen here",
    ranges={
        "surface_share": (0.10, 0.20),  # of the drums' heat capacity
        "onset_c": (110.0, 170.0),
        "width_k": (60.0, 130.0),
        "loss": (0.30, 0.55),  # share of the torque lost when fully hot
    },
    needs=("descent",),
)
class BrakeFade(Hidden):
    def start(self, batch: int) -> dict[str, Array]:
        ambient = np.full(batch, self.truck.ambient_temperature)
        return {"surface": ambient + 20.0, "body": ambient.copy()}

    def newtons(self, view: View, dt: float) -> Array:
        p, s, truck = self.p, self.s, self.truck
        hot = (s.surface - p.onset_c) / p.width_k
        lost = p.loss * np.where(hot > 0.0, 1.0 - np.exp(-(np.maximum(hot, 0.0) ** 2)), 0.0)
        capacity = 0.6 * truck.brake_heat_capacity
        inward = 0.02 * capacity * (s.surface - s.body)  # W; 50 s to level out
        outward = (truck.brake_cooling + truck.brake_cooling_speed * view.speed) * (
            s.body - truck.ambient_temperature
        )
        power = (1.0 - lost) * view.brake_force * view.speed
        s.surface += dt * (power - inward) / (p.surface_share * capacity)
        s.body += dt * (inward - outward) / ((1.0 - p.surface_share) * capacity)
        return lost * view.brake_force * moving(view)


@hidden(
    "brake_lag",
    source="Subramanian, Darbha and Rajagopal, J. Dyn. Sys. Meas. Control 126 (2004): choked flow fills the"
    " chamber"
    " at a rate with the square root of the pressure difference, after a transport delay",
    ranges={"dead_time_s": (0.10, 0.35), "fill_rate": (0.7, 1.6)},  # 1/s of full force at full difference
    needs=("suburban", "descent"),
    accepts=("command_delay", "clock_offset"),
)
class BrakeLag(Hidden):
    def start(self, batch: int) -> dict[str, Array]:
        self.steps = max(1, round(self.p.dead_time_s / 0.01))
        return {"pipe": np.zeros((self.steps, batch)), "chamber": np.zeros(batch), "at": np.zeros(1, int)}

    def newtons(self, view: View, dt: float) -> Array:
        full = 2.0e5
        slot = int(self.s.at[0]) % self.steps
        arrived = self.s.pipe[slot].copy()
        self.s.pipe[slot] = view.brake_force / full
        self.s.at[0] += 1
        difference = arrived - self.s.chamber
        rate = self.p.fill_rate * np.sign(difference) * np.sqrt(np.abs(difference))
        change = np.clip(rate * dt, -np.abs(difference), np.abs(difference))
        self.s.chamber += change
        return (view.brake_force - full * self.s.chamber) * moving(view)


@hidden(
    "dragging_brake",
    source="Residual shoe force of a sticking S-cam (Limpert, Brake Design and Safety, describes air brake"
    " adjustment); the decay after each application and the swelling with heat are chosen here",
    ranges={
        "floor_n": (300.0, 900.0),
        "stuck_n": (900.0, 3000.0),
        "ease_s": (12.0, 45.0),
        "swell": (0.1, 0.5),
    },
    needs=("suburban", "descent"),
)
class DraggingBrake(Hidden):
    def start(self, batch: int) -> dict[str, Array]:
        return {"stuck": np.zeros(batch), "heat": np.zeros(batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        applied = np.clip(view.brake_force / 2.0e4, 0.0, 1.0)
        s.stuck = np.maximum(s.stuck * (1.0 - dt / p.ease_s), p.stuck_n * applied)
        drag = (p.floor_n + s.stuck) * (1.0 + p.swell * s.heat)
        s.heat += dt * (drag * view.speed / 4.0e6 - s.heat / 200.0)
        return -drag * moving(view)


@hidden(
    "engine_brake",
    source="Compression release brake: torque that grows with engine speed, switched in stages of cylinders"
    " (Jacobs; see Heywood, Internal Combustion Engine Fundamentals, for the pumping work); exponent and"
    " delays are chosen here",
    ranges={
        "torque_nm": (250.0, 800.0),
        "exponent": (1.4, 2.1),
        "delay_s": (0.3, 0.6),
        "from_mps": (7.0, 12.0),
    },
    needs=("descent", "hills", "suburban"),
    accepts=("engine_friction",),
)
class SilentRetarder(Hidden):
    """A retarder switched by the driver, whose switch nobody records."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"closed": np.zeros(batch), "torque": np.zeros(batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        closed = (view.u[:, 0] <= 0.01 * abs(self.truck.full_command)) & (view.speed > p.from_mps)
        s.closed = np.where(closed & (view.shifting == 0.0), s.closed + dt, 0.0)
        stages = np.clip(np.floor((s.closed - p.delay_s) / 0.4 + 1.0), 0.0, 3.0) / 3.0
        wanted = stages * p.torque_nm * np.clip(view.engine_speed / 180.0, 0.0, 1.3) ** p.exponent
        s.torque += dt * (wanted - s.torque) / 0.08
        return -wheel_force(self.setting, view, s.torque) * moving(view)
