"""Open-loop error on held-out recordings, computed in the same way for the simulators of tool, refit and
oracle.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from deeptruck_core.arrays import Array
from deeptruck_core.signals import ACCELERATION, SPEED
from deeptruck_model.recordings import Recording
from deeptruck_model.simulators import Simulator

HORIZON_S = 40.0


@dataclass(frozen=True)
class OpenLoop:
    """Errors of free runs: speed (n_windows, steps) m/s, and acceleration likewise, m/s2."""

    speed: Array
    acceleration: Array

    def rmse(self) -> dict[str, float]:
        return {
            "speed_rmse": float(np.sqrt(np.mean(self.speed**2))),
            "acceleration_rmse": float(np.sqrt(np.mean(self.acceleration**2))),
        }


def arrays(recordings: Sequence[Recording]) -> tuple[Array, Array, Array]:
    """u, w and y of recordings cut to equal length, (batch, n, columns); invalid samples repeat the last
    valid one."""
    n = min(len(r) for r in recordings)
    u, w, y = (np.stack([_held(getattr(r, part)[:n]) for r in recordings]) for part in "uwy")
    return u, w, y


def _held(columns: Array) -> Array:
    out = columns.copy()
    for column in out.T:
        bad = np.isnan(column)
        if bad.any() and not bad.all():
            column[bad] = np.interp(np.flatnonzero(bad), np.flatnonzero(~bad), column[~bad])
    return np.nan_to_num(out)


def open_loop(
    simulator: Simulator,
    u: Array,
    w: Array,
    y: Array,
    extra: Array | None = None,
    horizon_s: float = HORIZON_S,
) -> OpenLoop:
    """Free runs of `horizon_s` from consecutive windows; between them the simulator is forced along the
    recording, so that gear, heat and boost are those of the drive. `extra` (batch, n) is an acceleration
    added to its response."""
    steps = round(horizon_s / simulator.dt)
    n = y.shape[1]
    speed, acceleration = [], []
    state: Any = simulator.reset(y[:, 0])
    for k in range(n - 1):
        if k % steps == 0 and k + steps < n:
            errors = _free(simulator, state, u, w, y, k, steps, extra)
            speed.append(errors[:, :, SPEED])
            acceleration.append(errors[:, :, ACCELERATION])
        state, _ = simulator.step(state, u[:, k], w[:, k])
        state = simulator.force(state, y[:, k + 1])
    return OpenLoop(np.concatenate(speed), np.concatenate(acceleration))


def _free(
    simulator: Simulator,
    state: Any,
    u: Array,
    w: Array,
    y: Array,
    start: int,
    steps: int,
    extra: Array | None,
) -> Array:
    errors = np.zeros((len(y), steps, y.shape[2]))
    for j in range(steps):
        k = start + j
        state, response = simulator.step(state, u[:, k], w[:, k])
        if extra is not None:
            response = response.copy()
            response[:, ACCELERATION] += extra[:, k + 1]
            response[:, SPEED] = np.maximum(response[:, SPEED] + simulator.dt * extra[:, k + 1], 0.0)
            state = simulator.force(state, response)
        errors[:, j] = response - y[:, k + 1]
    return errors
