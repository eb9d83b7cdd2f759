"""Hidden effects of what the truck carries."""

from __future__ import annotations

import numpy as np

from deeptruck_exam.hidden import GRAVITY, Array, Hidden, hidden, moving, some_drives
from deeptruck_model.trucks import View


@hidden(
    "payload_change",
    source="Newton's second law; 18-45 % of gross mass taken on or left between drives, chosen here",
    ranges={"share": (0.18, 0.45), "sign": (-1.0, 1.0), "share_of_drives": (0.3, 0.6)},
    needs=("suburban", "hills"),
    accepts=("mass",),
)
class Payload(Hidden):
    """Other mass in some of the recordings; the simulator knows the mass of the others."""

    def prepare(self) -> None:
        rng = self.setting.rng(8)
        drives = some_drives(rng, self.setting.batch, self.p.share_of_drives)
        sign = 1.0 if self.p.sign > -0.4 else -0.8
        self.share = np.where(drives, sign * self.p.share, 0.0)

    def newtons(self, view: View, dt: float) -> Array:
        extra = self.share * view.mass
        rolling = self.truck.rolling_resistance * GRAVITY * moving(view)
        return -extra * (view.acceleration * moving(view) + GRAVITY * view.grade + rolling)


@hidden(
    "load_slosh",
    source="Dodge, The New Dynamic Behavior of Liquids in Moving Containers, SwRI (2000): equivalent"
    " pendulum, its sine kept; contact with the bulkhead is chosen here",
    ranges={"share": (0.15, 0.40), "pendulum_m": (1.2, 4.5), "damping": (0.02, 0.10)},
    needs=("suburban",),
)
class Pendulum(Hidden):
    """The liquid is part of the known mass; what is unknown is that it swings."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"angle": np.zeros(batch), "rate": np.zeros(batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        omega2 = GRAVITY / p.pendulum_m
        bulkhead = 400.0 * np.sign(s.angle) * np.maximum(np.abs(s.angle) - 0.6, 0.0)
        turning = (
            -omega2 * np.sin(s.angle)
            - 2.0 * p.damping * np.sqrt(omega2) * s.rate
            - view.acceleration * np.cos(s.angle) / p.pendulum_m
            - bulkhead
        )
        s.rate += dt * turning
        s.angle += dt * s.rate
        return -p.share * view.mass * p.pendulum_m * turning * np.cos(s.angle) * moving(view)
