"""Bayesian regression with coloured, heavy-tailed noise of varying weight, as residuals have it.

Model: y = X b + n, with b ~ N(mean, sd^2) and n an autoregression whose innovations are Student-t with scale
sigma * relative(t). Autoregression and scale are fitted again for every X: one noise model from a
contaminated residual would absorb slow effects and confuse fast ones.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from deeptruck_core.arrays import Array, Indices, Mask
from deeptruck_model.mismatch.rules import Rules
from deeptruck_model.trucks.compiled import entry

ORDER = 5  # of the autoregression
TAIL = 5.0  # degrees of freedom of the innovations
Z95 = 1.96  # sds to either side of a 95 % interval
ORDINARY = 3.0  # robust sds of the residual beyond which it counts less for the autoregression


@dataclass(frozen=True)
class Series:
    """The observed residual y (n,), which samples count, and the relative uncertainty of each.

    `starts` (n,) is True at the first sample of each contiguous segment; `relative` >= 1 widens the
    innovations where the simulator is sensitive to input noise. `slow` bounds slow noise: the
    autoregression's coefficients add up to no more than 1 - sigma * slow.
    """

    y: Array
    valid: Mask
    starts: Mask
    relative: Array
    slow: float = 0.0
    rules: Rules = field(default_factory=Rules)

    def usable(self) -> Mask:
        """Samples whose ORDER predecessors are valid and in the same segment."""
        return _after(self.valid, self.starts)


@dataclass(frozen=True)
class Prior:
    """Independent normal priors, each (k,); `sign` is +1 for a coefficient that must not be negative,
    else 0."""

    mean: Array
    sd: Array
    sign: Array

    @staticmethod
    def join(*parts: Prior) -> Prior:
        """Several priors concatenated, in order."""
        return Prior(*(np.concatenate([getattr(p, f) for p in parts]) for f in ("mean", "sd", "sign")))


@dataclass(frozen=True)
class Fit:
    """The coefficients (k,) of largest posterior probability, and the fitted noise. `innovations` (n,) are in
    units of sigma and NaN where a sample does not count."""

    b: Array
    sigma: float
    ar: Array
    innovations: Array


def fit(series: Series, X: Array, prior: Prior, start: Fit | None = None) -> Fit:
    """Posterior mode. Coefficients that violate their sign are set to zero.

    X (n, k) may have k = 0. `start` gives the initial noise model; white noise by default. If no sample
    counts, as in a part of the recordings, it is that of the prior.
    """
    use, innovations = series.usable(), np.full(len(series.y), np.nan)
    if not use.any():
        return Fit(prior.mean.copy(), series.rules.noise_floor, np.zeros(ORDER), innovations)
    ar, sigma = (start.ar, start.sigma) if start else (np.zeros(ORDER), _spread(series.y[use]))
    b = prior.mean.copy()
    weight = np.ones(len(series.y))
    rel, rows = series.relative[use], np.flatnonzero(use)
    for turn in range(2 if start else 4):
        if turn:
            top = max(1.0 - sigma * series.slow, 0.0)
            ar = _autoregression(series, series.y - X @ b, use, weight, top)
        yw, Xw = whiten(series.y, ar, rows), whiten(X, ar, rows)
        for _ in range(2):
            b = ridge(yw, Xw, weight[use] / (rel * sigma) ** 2, prior)
            e = (yw - Xw @ b) / rel
            w = (TAIL + 1) / (TAIL + (e / sigma) ** 2)
            sigma = max(float(np.sqrt(np.mean(w * e**2))), series.rules.noise_floor)
            weight[use] = w
    innovations[use] = (yw - Xw @ b) / (rel * sigma)
    return Fit(b, sigma, ar, innovations)


def whiten(x: Array, ar: Array, rows: Indices, weight: Array | None = None) -> Array:
    """Filter rows (m,) of x (n,) or (n, k) by the inverse of the autoregression `ar` (ORDER,), and multiply
    by `weight` (m,). The first ORDER rows have no past and must not be among them."""
    wide = np.ascontiguousarray(x.reshape(len(x), -1), dtype=np.float64)
    out = np.empty((len(rows), wide.shape[1]))
    _whiten(wide, ar, rows, np.ones(len(rows)) if weight is None else weight, out)
    return out.reshape(len(rows), *x.shape[1:])


@entry
def _whiten(x: Array, ar: Array, rows: Indices, weight: Array, out: Array) -> None:
    a, b, c, d, e = ar[0], ar[1], ar[2], ar[3], ar[4]  # written out, it is vectorised along the columns
    for i in range(len(rows)):
        r, w = rows[i], weight[i]
        for j in range(x.shape[1]):
            before = a * x[r - 1, j] + b * x[r - 2, j] + c * x[r - 3, j] + d * x[r - 4, j] + e * x[r - 5, j]
            out[i, j] = w * (x[r, j] - before)


def ridge(y: Array, X: Array, weight: Array, prior: Prior) -> Array:
    """Coefficients (k,) by ridge regression of y (n,) on X (n, k) with sign constraints on some: the largest
    violations are set to zero until none is left."""
    root = np.sqrt(weight)
    Xr = X * root[:, None]
    H = Xr.T @ Xr + np.diag(1 / prior.sd**2)
    g = Xr.T @ (y * root) + prior.mean / prior.sd**2
    active = np.ones(len(g), dtype=bool)
    b = np.zeros(len(g))
    while active.any():
        b = np.zeros(len(g))
        b[active] = np.linalg.solve(H[np.ix_(active, active)], g[active])
        breach = np.where(active & (prior.sign > 0), b, 0.0)
        if breach.min(initial=0.0) >= 0.0:
            break
        active[int(np.argmin(breach / np.sqrt(1 / np.diag(H))))] = False
        b[~active] = 0.0
    return b


def _autoregression(series: Series, n: Array, use: Mask, weight: Array, top: float) -> Array:
    """Coefficients (ORDER,) by weighted least squares, shrunk inside the stable region.

    The noise model describes typical rows. An intermittent force would otherwise dominate the estimate and be
    absorbed as noise; rows therefore have less weight if the preceding ones are outliers (the generalised
    M-estimate of Denby and Martin, Journal of the American Statistical Association 74, 1979). Differentiated
    speed noise alone would make slow errors appear impossible, which they are not for any simulator; the sum
    of the coefficients is therefore at least zero, so that slow noise is at least as strong as white noise.
    It is at most `top`, because slower and stronger variations are forces.
    """
    lags = np.stack([np.roll(n, k) for k in range(1, ORDER + 1)], axis=1)[use]
    relative = series.relative[use]
    past = np.sqrt(np.mean(lags**2, axis=1)) / relative
    usual = max(1.4826 * float(np.median(np.abs(n[use] / relative))), series.rules.noise_floor)
    influence = np.minimum(ORDINARY * usual / np.maximum(past, 1e-12), 1.0) ** 2
    w = (influence * weight[use] / relative**2)[:, None]
    H = (lags * w).T @ lags
    white = series.rules.noise_floor**2 * float((influence * weight[use]).sum())  # no simulator is better
    H += np.eye(ORDER) * (1e-9 + 1e-6 * np.trace(H) / ORDER + white)
    ar = np.linalg.solve(H, (lags * w).T @ n[use]).astype(np.float64)
    beyond = ar.sum() - float(np.clip(ar.sum(), 0.0, top))
    if beyond:
        step = np.linalg.solve(H, np.ones(ORDER))
        ar -= step * (beyond / step.sum())
    largest = np.abs(np.roots(np.concatenate([[1.0], -ar]))).max(initial=0.0)
    shrink = min(1.0, 0.98 / largest) if largest > 0 else 1.0
    return ar * shrink ** np.arange(1, ORDER + 1)


def _after(valid: Mask, starts: Mask) -> Mask:
    use = valid.copy()
    for k in range(1, ORDER + 1):
        use[k:] &= valid[:-k]
        use[:k] = False
    for k in range(ORDER):
        use[k:] &= ~starts[: len(starts) - k]
    return use


def _spread(x: Array) -> float:
    if len(x) == 0:
        return 1.0
    return max(float(1.4826 * np.median(np.abs(x - np.median(x)))), 1e-6)
