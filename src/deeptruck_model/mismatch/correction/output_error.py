"""Sizes for driving: coefficients refitted to the residual as free runs add it up (output error).

The evidence weighs what every sample tells beyond its past. Where a form is not quite right, recordings with
little noise let fast changes decide, and what is slow comes out wrong; but free runs add up what is slow.
Which frequencies an inexact model is right at is a choice (Wahlberg and Ljung, IEEE Transactions on Automatic
Control 31, 1986), so the correction is fitted to what it is judged by.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from deeptruck_model.mismatch.posterior.search import Model, Search
from deeptruck_model.mismatch.residual.noise import ridge

Array = NDArray[np.float64]

ROUNDS = 4  # of weighing the prior against what is left
TELLS = 2.0  # independent numbers that a free run's error in speed tells: how far off, and where it bends


def refitted(search: Search, model: Model, horizon_s: float) -> Model:
    """The model with the coefficients that leave the least squares of speed error in free runs of
    `horizon_s`, to first order, under the same priors and signs."""
    counted, length = search.series.valid, max(1, round(horizon_s / search.e.dt))
    if not counted.any():
        return model  # its sizes are those of the priors
    columns, prior, _ = search.design(model)
    X = _added_up(search, columns, length)[counted]
    y = _added_up(search, search.series.y[:, None], length)[counted, 0]
    b = model.fit.b
    for _ in range(ROUNDS):
        left = max(float(np.mean((y - X @ b) ** 2)), search.rules.noise_floor**2)
        b, _ = ridge(y, X, np.full(len(y), TELLS / (length * left)), prior)
    return replace(model, fit=replace(model.fit, b=b))


def _added_up(search: Search, x: Array, length: int) -> Array:
    """Sums of x (n, k) over time, m/s, that begin anew every `length` rows; rows that do not count add
    nothing."""
    x, out = np.where(search.series.valid[:, None], x, 0.0), np.empty_like(x)
    for s in search.e.stretches:
        for begin in range(s.start, s.stop, length):
            rows = slice(begin, min(begin + length, s.stop))
            out[rows] = np.cumsum(x[rows], axis=0) * search.e.dt
    return out
