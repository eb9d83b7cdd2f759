"""Which speeds, commands and slopes a deep truck has learned from.

Beyond them it guesses, and a guess that is off is no sign of missing physics. What came of the commands is
left out on purpose: a truck that answers otherwise than it did is just what is looked for.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from deeptruck_model.recordings import Recording
from deeptruck_model.signals import SPEED

Array = NDArray[Any]

PER_S, MOST = 1.0, 50_000  # samples a second that are kept, and of all
SPEED_NEAR, GRADE_NEAR, COMMAND_NEAR = 2.0, 0.01, 0.1  # m/s, ratio, and of the command's range: alike
LEAST_S = 2.0  # of driving alike that teach


@dataclass(frozen=True)
class Driven:
    """Which speeds, commands and slopes a deep truck was trained on; beyond them its response is a guess.

    `samples` (n, k) float32 of speed, u and w, each divided by what counts as near; `near` (k,). The response
    is left out on purpose: a truck that answers the same commands otherwise is what is looked for.
    """

    samples: Array
    near: Array

    def covers(self, speed: Array, u: Array, w: Array) -> NDArray[np.bool_]:
        """True where the truck learned from driving alike. speed (n,), u (n, n_u), w (n, n_w)."""
        rows = np.column_stack([speed, u, w]) / self.near
        tree = cKDTree(self.samples)
        least = min(len(self.samples), round(LEAST_S * PER_S))
        distance = tree.query(rows, k=[least], p=np.inf, distance_upper_bound=1.0)[0][:, 0]
        return np.asarray(np.isfinite(distance))


def measure(recordings: Sequence[Recording], before: Driven | None = None) -> Driven:
    """What the recordings drove through, and what was driven `before` by a truck that is adapted to them."""
    rows = np.concatenate([_samples(r) for r in recordings])
    rows = rows[np.isfinite(rows).all(axis=1)]
    if before is not None:
        rows = np.concatenate([rows, before.samples * before.near])
    rows = rows[:: max(1, -(-len(rows) // MOST))]
    controls = len(recordings[0].interface.u)
    largest = np.abs(rows[:, 1 : 1 + controls]).max(axis=0, initial=0.0)
    grades = np.full(rows.shape[1] - 1 - controls, GRADE_NEAR)
    near = np.concatenate([[SPEED_NEAR], np.maximum(COMMAND_NEAR * largest, 1e-6), grades]).astype(np.float32)
    return Driven((rows / near).astype(np.float32), near)


def _samples(recording: Recording) -> Array:
    every = max(1, round(1.0 / (PER_S * recording.dt)))
    return np.column_stack([recording.y[:, SPEED], recording.u, recording.w])[::every]
