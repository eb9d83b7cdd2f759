"""What further terms gain, to first order, by which those worth a fit are chosen."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from deeptruck_model.mismatch.mechanisms import CandidateTerm
from deeptruck_model.mismatch.mechanisms.regimes import Products
from deeptruck_model.mismatch.posterior.regression import Model, Regression
from deeptruck_model.mismatch.residual.noise import whiten

Array = NDArray[np.float64]


def screened(
    search: Regression, base: Model, noise: Model, options: Sequence[CandidateTerm]
) -> list[CandidateTerm]:
    """The terms by what each gains on top of `base` to first order, most first, under other noise."""
    yw, Xw, H0, weight = search.whitened(base, noise)
    gains = []
    for t in options:
        C = whiten(t.columns, noise.fit.ar, search.rows, weight)
        gain = gain_of(Products.stacked([Products.of(C, yw, Xw)]), Xw.T @ yw, H0, t)[0]
        gains.append(float(gain) - search.rules.temper * float(np.log(t.trials)))
    return [options[k] for k in np.argsort(-np.array(gains), kind="stable")]


def gain_of(products: Products, Xty: Array, H0: Array, term: CandidateTerm) -> Array:
    """Evidence (G,) gained by columns, whitened and weighted, of G sets of products, beside the others."""
    across = products.XtC.swapaxes(1, 2)
    A = products.CtC - across @ (H0 @ products.XtC)
    pull = products.Cty - across @ (H0 @ Xty)
    P, m = 1.0 / term.prior.sd**2, term.prior.mean
    H = A + np.diag(P)
    g = pull - A @ m
    step = np.linalg.solve(H, g[:, :, None])[:, :, 0]
    gain: Array = 0.5 * np.sum(g * step, axis=1) - 0.5 * (np.linalg.slogdet(H)[1] - np.log(P).sum())
    gain += pull @ m - 0.5 * (A @ m) @ m
    if (term.prior.sign > 0).any():
        gain[((step + m) * term.prior.sign < 0).all(axis=1)] = -10.0
    return gain
