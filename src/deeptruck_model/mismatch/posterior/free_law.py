"""What no name explains, as laws of the recorded signals that are added while the evidence asks for it.

Boosted trees see what depends on many signals at once, but no swing, no lag and nothing fast; laws see these,
and need less data.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from sklearn.ensemble import HistGradientBoostingRegressor
from threadpoolctl import threadpool_limits

from deeptruck_model.mismatch.mechanisms import (
    LATE_SENSOR,
    CandidateTerm,
    Constants,
    acts_by,
    candidate_terms,
    law_signal,
    laws,
    leans_on,
    merge,
)
from deeptruck_model.mismatch.posterior.candidates import screen_terms
from deeptruck_model.mismatch.posterior.search import MOST_TERMS, Model, Search
from deeptruck_model.mismatch.residual.evidence import Evidence

Array = NDArray[np.float64]

PERIOD_S = 1.0
LEVELS = 40
LEAST_R2 = 0.1  # share of the held-out variance that trees, or a formula, must explain
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
    if e.model_discrepancy == 0.0:  # what a learned simulator learned badly is in its acceleration too
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


TRIED = 3  # of the best by approximate gain are fitted in full
PRIOR_SD = 0.3
ALIKE = {"engine_command": "engine", "brake_command": "brake", "drag": "speed"}
# Where a form may differ from the one that is known.
ANYWHERE = frozenset({"speed", "elapsed", "ratio", "lever", "gear", "engine_speed"})


@dataclass(frozen=True)
class LeftOver:
    """What signals predict of what a model leaves over, the nats gained, and the model with laws beside its
    names where these are better than trees."""

    free: FreeModel
    gain: float
    lawful: Model | None

    def is_form_of(self, name: CandidateTerm, e: Evidence) -> bool:
        """Whether the laws mostly act by the signals that a named term acts by: then they are another form
        of it rather than something else."""
        if self.lawful is None:
            return False
        own = _plain(frozenset[str]().union(*(part.expression.signals() for part in name.parts)))
        if "simulated" in own:  # what swings with the acceleration swings with the forces that make it
            own |= {"engine", "brake"}
        sizes = [(_acts_by(law), size) for law, size in _parts(e, self.lawful)]
        within = sum(size for signals, size in sizes if signals & own and signals <= own | ANYWHERE)
        return within > 0.5 * sum(size for _, size in sizes)


def left_over(search: Search, model: Model) -> LeftOver:
    """By trees or by laws, whichever is the better."""
    e = search.e
    left = e.residual - search.prediction(model)
    trees = free_model(e, left, search.series.relative)
    gain = max(search.gain_of(model, trees.prediction), 0.0) if trees.r2 > LEAST_R2 else 0.0
    known = _beside_a_late_sensor(search, model)
    grown = _grown(search, known)
    if grown.score - known.score <= max(gain, search.rules.told_gain):
        return LeftOver(trees, gain, None)
    return LeftOver(_as_free_model(e, left, grown, trees), grown.score - known.score, grown)


def _beside_a_late_sensor(search: Search, model: Model) -> Model:
    """The model with whatever filters the sensors have: lags of all forces together, or of the slope, are no
    physics."""
    each = candidate_terms(LATE_SENSOR, search.e)
    options = [*each, *([merge(each[0], each[1])] if len(each) > 1 else [])]
    models = [search.model((*model.named, s), model.free, model.fit) for s in options]
    return max([model, *models], key=lambda m: m.score)


def _grown(search: Search, model: Model) -> Model:
    """The model with as many laws beside its names as pay."""
    options, best = laws(search.e), model
    for _ in range(MOST_TERMS):
        taken = best.named[-1] if len(best.named) > len(model.named) else None
        tried = [s for _, s in screen_terms(search, best, options)[:TRIED]]
        wider = [merge(taken, s) if taken is not None else s for s in tried]
        models = [search.model((*model.named, s), model.free, best.fit) for s in wider]
        step = max(models, key=lambda m: m.score, default=best)
        if step.score < best.score + search.rules.told_gain:
            break
        best = step
    return best


def _as_free_model(e: Evidence, left: Array, grown: Model, trees: FreeModel) -> FreeModel:
    """The laws of a model as one prediction; a signal is as important as the forces that lean on it."""
    law = grown.named[-1]
    force = law.columns @ grown.coefficients(law.mechanism.effect)
    weight: dict[str, float] = {}
    for each, size in _parts(e, grown):
        for rank, name in enumerate(leans_on(each)):
            weight[name] = weight.get(name, 0.0) + size / (1 + rank)
    total = sum(weight.values()) or 1.0
    importance = {n: w / total for n, w in sorted(weight.items(), key=lambda item: -item[1])}
    known = trees.features | {n: law_signal(n).rows(e) for n in importance}
    return FreeModel(force, _crossed_r2(e, left, law.columns, grown.fit.sigma), importance, known)


def _parts(e: Evidence, grown: Model) -> list[tuple[Constants, float]]:
    """Each law of a model, and the sum of its squared force."""
    law = grown.named[-1]
    forces = law.columns * grown.coefficients(law.mechanism.effect)
    parts = law.variant.leaves
    ends = np.cumsum([len(law.mechanism.build(part)) for part in parts])
    each = np.split(forces, ends[:-1], axis=1)
    sizes = [float(np.sum(f.sum(axis=1)[e.valid] ** 2)) for f in each]
    return [(part.constants, size) for part, size in zip(parts, sizes, strict=True)]


def _acts_by(law: Constants) -> frozenset[str]:
    return _plain(acts_by(law))


def _plain(signals: frozenset[str]) -> frozenset[str]:
    """A command and its force are one; drag is speed's."""
    return frozenset(ALIKE.get(name, name) for name in signals)


def _crossed_r2(e: Evidence, left: Array, columns: Array, sigma: float) -> float:
    """Share of what was left (n,) that the columns predict in each half of the recordings from the other."""
    half = e.record % 2 if e.record[-1] > 0 else (np.arange(len(e)) > len(e) // 2).astype(int)
    error = total = 0.0
    for k in (0, 1):
        fit, test = e.valid & (half != k), e.valid & (half == k)
        H = columns[fit].T @ columns[fit] + (sigma / PRIOR_SD) ** 2 * np.eye(columns.shape[1])
        b = np.linalg.solve(H, columns[fit].T @ left[fit])
        error += float(np.sum((left[test] - columns[test] @ b) ** 2))
        total += float(np.sum(left[test] ** 2))
    return 1.0 - error / max(total, 1e-12)
