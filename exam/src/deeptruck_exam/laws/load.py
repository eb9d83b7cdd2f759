"""Load: sloshing and other payloads."""

from __future__ import annotations

import numpy as np

from deeptruck_core.arrays import Array
from deeptruck_exam.laws.catalogue import SIGN, law, sizes
from deeptruck_exam.laws.law import GRAVITY, Law, Sizes, State, moving
from deeptruck_exam.laws.series import some_drives
from deeptruck_model.trucks import View


@law("load_slosh", "suburban")
@sizes(share=(0.15, 0.40), pendulum_m=(1.2, 4.5), damping=(0.02, 0.10))
class Pendulum(Law, angle=0.0, rate=0.0):
    """Liquid that is part of the known mass and sloshes.
    Source: Dodge, The New Dynamic Behavior of Liquids in Moving Containers, SwRI (2000): equivalent pendulum,
    without small-angle approximation, with contact at the bulkhead."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        omega2 = GRAVITY / p.pendulum_m
        # rad/s^2 for each rad beyond 0.6, where the liquid meets the bulkhead
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


@law("load_slosh", "suburban")
@sizes(share=(0.35, 0.65), length_m=(4.5, 9.0), fill=(0.12, 0.30), baffles=(0.3, 1.2))
class BaffledTank(Law):
    """Two simultaneous sloshing modes, damped by baffles with the square of the flow. share: liquid over
    gross mass; fill: depth over length; baffles: 1/m.
    Source: Ibrahim, Liquid Sloshing Dynamics (2005): frequencies and masses of the first and third
    antisymmetric mode of a rectangular tank."""

    def prepare(self) -> None:
        n = np.array([[1.0], [3.0]])
        depth = n * np.pi * self.p.fill
        self.omega2 = n * np.pi * GRAVITY / self.p.length_m * np.tanh(depth)
        self.part = 8.0 * np.tanh(depth) / (n**2 * np.pi**2 * depth)

    def start(self, batch: int) -> dict[str, Array]:
        return {"way": np.zeros((2, batch)), "rate": np.zeros((2, batch))}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        damping = (p.baffles * np.abs(s.rate) + 0.02 * np.sqrt(self.omega2)) * s.rate
        driven = -self.omega2 * s.way - damping - np.clip(view.acceleration, -6.0, 6.0)
        s.rate += dt * driven
        s.way = np.clip(s.way + dt * s.rate, -1.5, 1.5)
        # the liquid is part of the known mass: what it does not follow of the truck's motion is missing
        moved = (self.part * driven).sum(axis=0)
        return -p.share * view.mass * moved * moving(view)


@law("payload_change", "suburban hills", accepts="mass")
@sizes(share=(0.18, 0.45), sign=SIGN, share_of_drives=(0.3, 0.6))
class OtherPayload(Law):
    """Another mass in some of the recordings; the simulator has the mass of the others.
    Source: Newton's second law."""

    def prepare(self) -> None:
        rng = self.rng(8)
        drives = some_drives(rng, self.setting.batch, self.p.share_of_drives)
        sign = 1.0 if self.p.sign > -0.4 else -0.8
        self.share = np.where(drives, sign * self.p.share, 0.0)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        extra = self.share * view.mass
        rolling = self.truck.rolling_resistance * GRAVITY * moving(view)
        return -extra * (view.acceleration * moving(view) + GRAVITY * view.grade + rolling)
