"""A free, unnamed model of the residual: what could be explained at all by the signals at hand.

Gradient boosting, always predicted for recordings (or long blocks of one recording) it was not fitted on. Its
prediction enters the same evidence as a named mechanism does, as one column, so the two can be weighed
against each other.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from sklearn.ensemble import HistGradientBoostingRegressor
from threadpoolctl import threadpool_limits

from deeptruck_model.mismatch.residual.evidence import Evidence

Array = NDArray[np.float64]

PERIOD_S = 1.0
LEVELS = 40
RATIO_STEP = 0.05  # relative; gears are farther apart
FOLDS = 6
CLIP = (
    6.0  # residuals beyond this many robust sds are clipped: the free model is about structure, not outliers
)


@dataclass(frozen=True)
class FreeModel:
    """Out-of-fold prediction of the residual (n,), its r2 on those folds, and features by importance."""

    prediction: Array
    r2: float
    importance: dict[str, float]
    features: dict[str, Array]


def features(e: Evidence) -> dict[str, Array]:
    """Signals and short memories of them, (n,) each."""
    out = {name: e[name] for name in ("speed", "engine", "brake")}
    for name in (
        "grade",
        "gear",
        "gap",
        "ambient_temperature",
        "elevation",
        "elapsed",
    ):
        if e.has(name):
            out[name] = e[name]
    if e.has("ratio"):
        # engine speed and speed are not sampled at one moment, so that their ratio tells the acceleration
        coarse = np.log(np.maximum(np.nan_to_num(e["ratio"]), 1e-3)) / RATIO_STEP
        out["ratio"] = np.exp(np.round(coarse) * RATIO_STEP)
        out["engine_speed"] = out["ratio"] * e["speed"]
    for name in ("engine_command", "brake_command"):
        if e.has(name):
            out[name] = e[name]
            out[f"change of {name}"] = e[name] - e.lag(e[name], 1.0)
    pull, power = np.maximum(e["engine"], 0.0), e["brake"] * e["speed"]
    out["engine over 3 s"], out["engine over 60 s"] = e.lag(pull, 3.0), e.lag(pull, 60.0, "zero")
    if e.own_error == 0.0:  # what a learned simulator learned badly is in its acceleration too
        out["simulated"], out["acceleration over 2 s"] = e["simulated"], e.lag(e["simulated"], 2.0)
    if power.max(initial=0.0) > 0:
        out["braking power over 60 s"], out["braking power over 300 s"] = (
            e.lag(power, 60.0, "zero"),
            e.lag(power, 300.0, "zero"),
        )
        out["time since braking"] = np.minimum(e.since(e["brake"] > 0.1), 300.0)
    return out


def free_model(e: Evidence, residual: Array, doubt: Array, seed: int = 0) -> FreeModel:
    """Predict `residual` (n,), what a named model left over, from signals; honest by folds.

    `doubt` (n,) >= 1 is the relative uncertainty of each sample.
    """
    named = features(e)
    per = max(1, round(PERIOD_S / e.dt))
    rows = np.arange(len(e) // per * per).reshape(-1, per)
    ok = e.valid[rows].all(axis=1)
    rows = rows[ok]
    if len(rows) < 120:
        return FreeModel(np.zeros(len(e)), 0.0, {}, named)
    X = np.stack([_levels(x[rows].mean(axis=1)) for x in named.values()], axis=1)
    y = residual[rows].mean(axis=1)
    scale = 1.4826 * np.median(np.abs(y - np.median(y))) + 1e-9
    y = np.clip(y, -CLIP * scale, CLIP * scale)
    weight = 1.0 / (doubt[rows] ** 2).mean(axis=1)
    folds = _folds(e.record[rows[:, 0]])
    predicted, importance = np.zeros(len(y)), np.zeros(X.shape[1])
    rng = np.random.default_rng(seed)
    for fold in np.unique(folds):
        test = folds == fold
        model = _model(seed)
        with threadpool_limits(1):
            model.fit(X[~test], y[~test], sample_weight=weight[~test])
        predicted[test] = model.predict(X[test])
        importance += _permuted(model, X[test], y[test], weight[test], rng)
    full = np.zeros(len(e))
    full[rows] = predicted[:, None]
    r2 = 1.0 - float(weight @ (y - predicted) ** 2 / max(weight @ y**2, 1e-12))
    total = max(float(importance.clip(0).sum()), 1e-12)
    shares = {name: float(max(i, 0.0)) / total for name, i in zip(named, importance, strict=True)}
    return FreeModel(full, r2, dict(sorted(shares.items(), key=lambda kv: -kv[1])), named)


def _model(seed: int) -> HistGradientBoostingRegressor:
    return HistGradientBoostingRegressor(
        max_iter=80,
        learning_rate=0.08,
        max_leaf_nodes=12,
        min_samples_leaf=25,
        l2_regularization=5.0,
        random_state=seed,
    )


def _edges(x: Array) -> Array:
    """LEVELS quantiles: trees need no more, and the library bins few distinct values far faster."""
    return np.quantile(x, np.linspace(0.0, 1.0, LEVELS + 1)[1:-1]).astype(np.float64)


def _levels(x: Array) -> Array:
    return np.searchsorted(_edges(x), x).astype(float)


def _folds(record: NDArray[np.intp]) -> NDArray[np.intp]:
    """Whole recordings dealt to folds; long blocks of equal length where there are too few recordings."""
    if len(np.unique(record)) >= 4:
        return record % FOLDS
    blocks: NDArray[np.intp] = (np.arange(len(record)) * (4 * FOLDS) // len(record)) % FOLDS
    return blocks


def _permuted(
    model: HistGradientBoostingRegressor, X: Array, y: Array, weight: Array, rng: np.random.Generator
) -> Array:
    """Loss in squared error on unseen rows when one feature is shuffled."""
    base = weight @ (y - model.predict(X)) ** 2
    out = np.zeros(X.shape[1])
    for j in range(X.shape[1]):
        shuffled = X.copy()
        shuffled[:, j] = rng.permutation(shuffled[:, j])
        out[j] = weight @ (y - model.predict(shuffled)) ** 2 - base
    return out
