"""The smallest errors that these recordings would have shown: what 'nothing missing' means in numbers."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from deeptruck_model.mismatch.posterior.regression import Regression
from deeptruck_model.mismatch.residual.noise import Z95, whiten
from deeptruck_model.mismatch.result import SmallestVisible
from deeptruck_model.mismatch.rules import Rules

Array = NDArray[np.float64]


def smallest_visible(search: Regression, threshold: float, rules: Rules) -> SmallestVisible:
    """Relative errors of parameters that gain what a parameter must, and a steady force per mass (m/s^2) that
    gains `threshold` nats beside free parameters, under the noise of these recordings."""
    free = search.model((), frozenset(search.parameters))
    noise = search.background(())
    _, Xw, H0, weight = search.whitened(free, noise)

    def information(column: Array, H: Array, X: Array) -> float:
        """Nats that a column of unit size gains, twice, beside the columns X, whitened."""
        c = whiten(np.nan_to_num(column)[:, None], noise.fit.ar, search.rows, weight)[:, 0]
        along = X.T @ c
        return max(float(c @ c - along @ H @ along), 1e-12)

    always = np.sqrt(_of_gain(threshold) / information(np.ones(len(search.e)), H0, Xw))
    _, held_X, held_H, _ = search.whitened(search.model((), frozenset()), noise)
    relative = {}
    for p in search.parameters:
        others = np.arange(Xw.shape[1]) != dict(free.layout)[f"parameter:{p}"].start
        X = held_X[:, others]
        H = np.linalg.inv(np.linalg.inv(held_H)[np.ix_(others, others)])
        known = information(search.e.sensitivity[p], H, X)
        size = np.sqrt(_of_gain(rules.parameter_gain) / known)
        certain = rules.nearly_right + Z95 * np.sqrt(rules.temper / known)
        relative[p] = round(float(max(size, certain)), 4)
    mass = search.e.mass if search.e.mass_known else None
    return SmallestVisible(relative, round(float(always), 4), mass)


def _of_gain(nats: float) -> float:
    """Squared size x, in its standard deviations, of an effect that gains (x - log(1 + x)) / 2 nats: the
    logarithm is what its prior costs."""
    return float(brentq(lambda x: 0.5 * x - 0.5 * np.log1p(x) - nats, 0.1, 1e6))
