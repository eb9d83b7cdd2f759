"""Tunes the simulator as its owner would: least squares on the recordings that contain the effect, with a
model that lacks it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.optimize import least_squares

from deeptruck_core.arrays import Array
from deeptruck_exam.cases.build import second_means
from deeptruck_exam.cases.plan import Plan
from deeptruck_exam.worlds import trucks
from deeptruck_model import trucks as pool
from deeptruck_model.recordings import Recording

REACH = 0.25  # largest change of the logarithm of a parameter an owner would accept
OUTLIER = 0.2  # m/s^2, beyond which an error weighs less than by its square
EVALUATIONS = 12  # of the residuals at most, not counting those of their slopes


def absorb(plan: Plan, recordings: Sequence[Recording]) -> dict[str, float]:
    """The simulator's parameters after re-tuning on recordings of equal length."""
    start = {name: plan.simulator_values.get(name, 1.0) for name in trucks.TUNABLE}
    base = trucks.make(plan.truck, plan.simulator_values, grade=plan.grade)
    tuned = retune(base, start, recordings)
    return {**plan.simulator_values, **tuned}


def retune(
    truck: pool.PhysicsTruck, start: Mapping[str, float], recordings: Sequence[Recording]
) -> dict[str, float]:
    """Least squares over `start`'s parameters of one-second means of the forced acceleration error."""
    u, w, y = (np.stack([getattr(r, part) for r in recordings]) for part in "uwy")
    names = list(start)
    first = np.array([start[name] for name in names])

    def error(log_factor: Array) -> Array:
        values = dict(zip(names, (first * np.exp(log_factor)).tolist(), strict=True))
        run = truck.with_parameters(values).rollout(u, w, y[:, 0], y, inside=False)
        return second_means(run.y[:, 1:, 0] - y[:, 1:, 0]).ravel()

    found = least_squares(
        error,
        np.zeros(len(names)),
        bounds=(-REACH, REACH),
        diff_step=0.01,
        max_nfev=EVALUATIONS,
        loss="soft_l1",
        f_scale=OUTLIER,
    )
    return dict(zip(names, (first * np.exp(found.x)).tolist(), strict=True))
