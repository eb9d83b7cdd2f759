"""Kalman filter that tracks the leader, so that radar noise does not reach the pedals.

A policy that keeps a gap to 0.1 s turns 0.1 m of noise in one reading into a tenth of the truck's power. The
truck's own motion is an input of the filter, so that only changes of the leader are delayed.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np


def library(values: Any) -> Any:
    """numpy for its arrays, else torch, which a controller does not load."""
    return np if isinstance(values, np.ndarray) else sys.modules["torch"]


@dataclass(frozen=True)
class RadarFilter:
    """Steady-state Kalman filter for a leader whose acceleration is a random walk.

    Bar-Shalom, Li and Kirubarajan (2001), Estimation with Applications to Tracking and Navigation, 6.3.3: the
    discrete Wiener process acceleration model, with the truck's own speed as a known input. A track (batch,
    3) is the predicted gap (m), leader speed (m/s) and leader acceleration (m/s^2) at the next reading; NaN
    means 'none yet'. A reading that differs from it by more than `lost_m` or `lost_speed` begins a new track,
    for another vehicle or a leader that brakes harder than the filter can follow.
    """

    gain: tuple[tuple[float, float], ...]  # (3, 2): of the track, by the errors of gap and leader speed
    dt: float = 0.1
    lost_m: float = 1.0
    lost_speed: float = 0.5

    @classmethod
    def steady(
        cls, dt: float = 0.1, *, range_sd: float = 0.1, speed_sd: float = 0.05, wander: float = 0.1
    ) -> RadarFilter:
        """The steady-state gain of the discrete Riccati equation.

        `range_sd` (m) and `speed_sd` (m/s) are the radar's noise in one reading, with the values of the
        leader node; the leader's acceleration changes by `wander` (m/s^2, sd) in a second. Only their ratios
        matter.
        """
        from scipy.linalg import solve_discrete_are  # not loaded for --help and refusals

        noise, step = np.diag([range_sd**2, speed_sd**2]), np.eye(3) + dt * np.eye(3, k=1)
        expected = solve_discrete_are(step.T, np.eye(3, 2), np.diag([0.0, 0.0, wander**2 * dt]), noise)
        gain = expected[:, :2] @ np.linalg.inv(expected[:2, :2] + noise)
        return cls(tuple((float(a), float(b)) for a, b in gain), dt)

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> RadarFilter:
        """Inverse of dataclasses.asdict, also after JSON."""
        return cls(**{**data, "gain": tuple((float(a), float(b)) for a, b in data["gain"])})

    def __call__(self, signals: Any, track: Any) -> tuple[Any, Any]:
        """Signals (batch, 5) with estimated gap and leader speed, and the next track; numpy arrays or torch
        tensors."""
        xp, seen = library(signals), signals[:, [2, 0]]
        off = xp.abs(seen - track[:, :2])
        kept = (off[:, :1] < self.lost_m) & (off[:, 1:] < self.lost_speed)  # NaN is not
        track = xp.where(kept, track, xp.concatenate([seen, xp.zeros_like(seen[:, :1])], 1))
        track = track + (seen - track[:, :2]) @ xp.asarray(self.gain, dtype=signals.dtype).T
        gap, leader, pull = track.T
        speed, target, grade = signals[:, [1, 3, 4]].T
        expected = [gap + self.dt * (leader - speed), leader + self.dt * pull, pull]
        return xp.stack([leader, speed, gap, target, grade], 1), xp.stack(expected, 1)
