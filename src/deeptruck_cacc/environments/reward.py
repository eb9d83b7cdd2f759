"""The paper's reward, and a shaped form of it that trains better."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np


@dataclass(frozen=True)
class Reward:
    """The paper's reward, with h in place of the square.

    r = -alpha_p h(gap - v Tg) - alpha_v h(v_leader - v) - alpha_e e^2 - alpha_b b^2 - alpha_crash [gap <=
    d_safety]

    e and b are the commands as fractions of their ranges. h(x) = 2 d^2 (sqrt(1 + (x/d)^2) - 1) is x^2 near
    zero and linear, with slope 2 d, far away; d = inf is the paper's square. Accepts numpy arrays and torch
    tensors.
    """

    alpha_p: float = 0.2
    alpha_v: float = 0.5
    alpha_e: float = 0.01
    alpha_b: float = 0.2
    alpha_crash: float = 1000.0
    d_safety: float = 2.0
    knee_gap_m: float = 0.5
    knee_speed: float = 0.3
    scale: float = 0.1  # of the whole reward: returns of order 100 suit a value network

    @classmethod
    def paper(cls, alpha_crash: float = 100.0) -> Reward:
        """The quadratic form as printed. The paper gives no constants: the policies of docs/results/paper.md
        were trained with `alpha_crash` 100; the other constants are those of the shaped form."""
        return cls(alpha_crash=alpha_crash, knee_gap_m=np.inf, knee_speed=np.inf)

    def tracking(self, gap_error: Any, speed_error: Any) -> Any:
        """Cost of the two errors (m, m/s), without crash and actuation; differentiable."""
        gap = self.alpha_p * shaped_square(gap_error, self.knee_gap_m)
        return gap + self.alpha_v * shaped_square(speed_error, self.knee_speed)

    def effort(self, engine: Any, brake: Any) -> Any:
        """Cost of the commands, given as fractions of their ranges."""
        return self.alpha_e * engine**2 + self.alpha_b * brake**2

    def __call__(self, gap: Any, gap_error: Any, speed_error: Any, engine: Any, brake: Any) -> Any:
        """Reward, elementwise. Gap and gap error in m, speed error in m/s, commands as fractions."""
        crash = self.alpha_crash * (gap <= self.d_safety)
        return -self.scale * (self.tracking(gap_error, speed_error) + self.effort(engine, brake) + crash)


def shaped_square(x: Any, knee: float) -> Any:
    """x^2 below the knee, 2 knee |x| above it, smooth between; exactly x^2 for an infinite knee."""
    if np.isinf(knee):
        return x**2
    return 2 * knee**2 * ((1 + (x / knee) ** 2) ** 0.5 - 1)
