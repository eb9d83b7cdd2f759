"""The accelerometer of a simulated truck, which feels the slope of the road."""

from __future__ import annotations

import numpy as np

from deeptruck_core.constants import GRAVITY


class Accelerometer:
    """A truck's accelerometer along its length: gravity on slopes, a bias, white noise, and the pitch of the
    cab, which leans back when the truck pulls."""

    BIAS, NOISE, PITCH = 0.03, 0.04, 0.02  # m/s^2; m/s^2; m/s^2 of gravity for 1 m/s^2

    def __init__(self, seed: int) -> None:
        rng = np.random.default_rng(seed)
        self._bias, self._rng = float(rng.normal(0.0, self.BIAS)), rng

    def reads(self, acceleration: float, slope: float) -> float:
        """One reading, m/s^2, at this acceleration and slope of the road (rise over run)."""
        gravity = GRAVITY * slope / float(np.hypot(1.0, slope))
        return (
            (1.0 + self.PITCH) * acceleration
            + gravity
            + self._bias
            + float(self._rng.normal(0.0, self.NOISE))
        )
