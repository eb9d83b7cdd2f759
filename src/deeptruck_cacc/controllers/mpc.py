"""A small model predictive controller: ten accelerations of 0.5 s, one quadratic programme per step (OSQP).

It predicts gap and speed while the leader's acceleration decays, weighs their errors against changes of the
commands, and keeps `LEAST_GAP_M` whenever the limits of the pedals allow.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

from deeptruck_cacc.controllers.law import LEAST_GAP_M, Seen
from deeptruck_core.arrays import Array

STEPS, STEP_S = 10, 0.5
LIMITS = (-3.5, 1.5)  # m/s^2
# Costs of m^2, (m/s)^2, (m/s^2)^2, a change of acceleration squared, and of a metre below the least gap.
GAP, SPEED, PULL, CHANGE, TOO_NEAR = 0.3, 1.0, 0.02, 0.5, 100.0

_LATER = np.arange(1, STEPS + 1)[:, None] - np.arange(STEPS)  # steps from the beginning of a_j to time k
_SPEED = STEP_S * (_LATER > 0)  # speeds at the ends of the steps, from the accelerations
_WAY = STEP_S**2 * np.maximum(_LATER - 0.5, 0.0)
_TIME: Array = STEP_S * np.arange(1.0, STEPS + 1, dtype=float)
_CHANGE = np.eye(STEPS) - np.eye(STEPS, k=-1)
_LOWER = np.tril_indices(STEPS)


def mpc(seen: Seen) -> Array:
    """Requested acceleration, m/s^2, (batch,); NaN if an observation is NaN."""
    hessian, linear, room = _programmes(seen)
    out = np.full(len(room), np.nan)
    for k in np.flatnonzero(np.isfinite(linear).all(axis=1) & np.isfinite(room).all(axis=1)):
        out[k] = _solve(hessian[k], linear[k], room[k])
    return out


def _programmes(seen: Seen) -> tuple[Array, Array, Array]:
    """Hessian (batch, n, n) and linear cost (batch, n) of the accelerations, and the gap (batch, n) above
    LEAST_GAP_M without any acceleration."""
    time_gap = seen.time_gap
    speed, gap = seen.speed[:, None], seen.gap[:, None]
    leader_speed, leader_way = seen.leader(_TIME)
    left = gap + leader_way - speed * _TIME
    gap_error, speed_error = left - time_gap[:, None] * speed, leader_speed - speed
    toward = _WAY + time_gap[:, None, None] * _SPEED  # how the accelerations reduce the gap error
    now = np.zeros_like(left)
    now[:, 0] = seen.acceleration
    turned = toward.swapaxes(1, 2)
    fixed = SPEED * _SPEED.T @ _SPEED + PULL * np.eye(STEPS) + CHANGE * _CHANGE.T @ _CHANGE
    linear = GAP * np.einsum("bij,bj->bi", turned, gap_error) + SPEED * speed_error @ _SPEED
    return 2 * (GAP * turned @ toward + fixed), -2 * (linear + CHANGE * now @ _CHANGE), left - LEAST_GAP_M


def _solve(hessian: Array, linear: Array, room: Array) -> float:
    solver = _solver()
    upper = np.concatenate([np.full(STEPS, LIMITS[1]), [np.inf], room])
    solver.update(Px=_columns(hessian), q=np.append(linear, 0.0), u=upper)
    return float(solver.solve(raise_error=False).x[0])


def _columns(hessian: Array) -> Array:
    """The upper triangle column by column, and the cost of too small a gap, in OSQP's format."""
    return np.append(hessian.T[_LOWER], 2 * TOO_NEAR)  # symmetric: its lower rows are the upper columns


@cache
def _solver() -> Any:
    """One workspace for all programmes, which have the same shape.

    Cold starts and a fixed rho, so that rows do not affect each other.
    """
    import osqp
    from scipy import sparse

    n = STEPS + 1  # the last variable is how far below the least gap
    hessian = np.zeros((n, n))
    hessian[:STEPS, :STEPS] = 1.0 + np.eye(STEPS)
    hessian[-1, -1] = 2 * TOO_NEAR
    rows = np.vstack([np.eye(n), np.column_stack([_WAY, -np.ones(STEPS)])])
    lower = np.concatenate([np.full(STEPS, LIMITS[0]), [0.0], np.full(STEPS, -np.inf)])
    solver = osqp.OSQP()
    solver.setup(
        sparse.csc_matrix(np.triu(hessian)),
        np.zeros(n),
        sparse.csc_matrix(rows),
        lower,
        np.full(len(rows), np.inf),
        verbose=False,
        warm_starting=False,
        eps_abs=1e-4,
        eps_rel=1e-4,
        max_iter=4000,
        adaptive_rho=False,
        rho=0.1,
    )
    return solver
