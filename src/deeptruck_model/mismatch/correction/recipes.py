"""What a correction may consist of, and which recipe predicts best the fitted drives that are left out.

Errors are those of speed, to first order: what a recipe leaves of the residual, added up as a free run does.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from deeptruck_core.arrays import Array, Mask
from deeptruck_model.mismatch.mechanisms import CandidateTerm
from deeptruck_model.mismatch.mechanisms.families import FAMILY
from deeptruck_model.mismatch.posterior.names import Named
from deeptruck_model.mismatch.posterior.regression import PINNED, Model, Regression
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.residual.noise import ridge
from deeptruck_model.mismatch.rules import Limits, Rules

FOLDS = 3
ROUNDS = 4  # of weighing the prior against what is left
FREE_RUN_NUMBERS = 2.0  # independent numbers in a free run's error: its offset and its curvature


@dataclass(frozen=True)
class Recipe:
    """What is fitted: `terms` and `free` parameters, with sizes by evidence or by `output_error`."""

    terms: tuple[CandidateTerm, ...] = ()
    free: frozenset[str] = frozenset()
    output_error: bool = False

    @property
    def coefficients(self) -> int:
        """The number of fitted coefficients."""
        return sum(t.columns.shape[1] for t in self.terms) + len(self.free)

    @property
    def names(self) -> set[str]:
        """Effects and parameters in it."""
        return {*(t.mechanism.effect for t in self.terms), *self.free}

    def without(self, name: str) -> Recipe:
        """The same without an effect or a parameter."""
        terms = tuple(t for t in self.terms if t.mechanism.effect != name)
        return replace(self, terms=terms, free=self.free - {name})


@dataclass(frozen=True)
class Fold:
    """A regression on some of the fitted drives, and the rows (n,) of the others."""

    regression: Regression
    left_out: Mask


@dataclass(frozen=True)
class Judged:
    """A recipe, and the squared speed errors ((m/s)^2) of every drive by a fit to others, and their number,
    (drives, 2)."""

    recipe: Recipe
    errors: Array

    @property
    def rms(self) -> float:
        """Root mean square over all drives, m/s."""
        squares, count = self.errors.sum(axis=0)
        return float(np.sqrt(squares / max(count, 1.0)))

    @property
    def of_drives(self) -> Array:
        """Root mean square of each drive (drives,), m/s."""
        return np.asarray(np.sqrt(self.errors[:, 0] / np.maximum(self.errors[:, 1], 1.0)))


def left_out_in_turn(e: Evidence) -> list[Fold]:
    """Parts of the fitted drives that are left out in turn; if drives are too few, one fold that fits and
    tests all."""
    fitted = np.flatnonzero([not s.held_out for s in e.drives])
    parts = [fitted[k::FOLDS] for k in range(FOLDS)] if len(fitted) >= FOLDS else []
    if not parts:
        return [Fold(Regression(e, parameter_sd=PINNED), e.valid & ~e.held_out)]
    out = []
    for away in parts:
        there = np.isin(e.record, away)
        out.append(
            Fold(Regression(e, only=e.valid & ~e.held_out & ~there, parameter_sd=PINNED), e.valid & there)
        )
    return out


def judged(folds: Sequence[Fold], recipe: Recipe) -> Judged:
    """A recipe with its errors along drives to which it was not fitted."""
    out = []
    for fold in folds:
        s = fold.regression
        left = s.e.residual - _acts(s, fitted(s, recipe))
        speed = np.where(fold.left_out, _added_up(s, left[:, None], fold.left_out)[:, 0], 0.0)
        for drive in np.unique(s.e.record[fold.left_out]):
            rows = s.e.record == drive
            out.append((float(speed[rows] @ speed[rows]), int(fold.left_out[rows].sum())))
    return Judged(recipe, np.array(out, dtype=float).reshape(-1, 2))


def pruned(
    folds: Sequence[Fold], recipe: Recipe, probability: Callable[[str], float], rules: Rules
) -> Iterator[Judged]:
    """A recipe, and what is left of it as each term and each parameter, the least probable first, is omitted
    whose absence hardly raises the error of drives left out."""
    whole = judged(folds, recipe)
    yield whole
    for part in sorted(sorted(recipe.names), key=probability):  # of equal ones, in any process the same
        less = recipe.without(part)
        if less.names and (without := judged(folds, less)).rms <= whole.rms / rules.better:
            recipe = less
            yield without


def subsets(folds: Sequence[Fold], parameters: Sequence[str]) -> Iterator[Judged]:
    """Recipes of parameters alone, every subset, and the best of each size by output error. Pruning misses
    pairs: more mass is the same as less torque, brake and drag together."""
    for count in range(1, len(parameters) + 1):
        each = [judged(folds, Recipe((), frozenset(free))) for free in combinations(parameters, count)]
        yield from each
        yield judged(folds, replace(min(each, key=lambda x: x.rms).recipe, output_error=True))


def needless(folds: Sequence[Fold], recipe: Recipe, found: Sequence[Named], stated: float) -> frozenset[str]:
    """Names without which drives left out are predicted as well, beside the names that are more probable. One
    that the recipe lacks, as no form carries it to other drives, is needless below probability `stated` if a
    more probable one is of its family: it may be what that one's form leaves."""
    out = {
        f.name
        for k, f in enumerate(found)
        if f.name not in recipe.names
        and f.tree.names[f.name] < stated
        and any(FAMILY[f.name] == FAMILY[more.name] for more in found[:k])
    }
    whole = judged(folds, recipe)
    for name in (f.name for f in reversed(found) if f.name in recipe.names):
        less = whole.recipe.without(name)
        if (without := judged(folds, less)).rms <= whole.rms:
            whole = without
            out.add(name)
    return frozenset(out)


def best(options: Sequence[Judged], rules: Rules) -> Judged:
    """Of the recipes whose error is nearly the least, beside noise of speed, the one with the fewest
    coefficients."""
    each = np.hypot([x.rms for x in options], Limits.speed_noise)
    near = np.flatnonzero(each <= each.min() / rules.better)
    return options[min(near, key=lambda k: (options[k].recipe.coefficients, each[k]))]


def nested(options: Sequence[Judged], rules: Rules) -> Array:
    """Errors of every drive (drives,), m/s, by the recipe that is best on the others (nested choice): one
    that was chosen on all drives would be judged too well on each."""
    by_recipe = {id(x.recipe): x.of_drives for x in options}
    chosen = [
        best([replace(x, errors=np.delete(x.errors, k, axis=0)) for x in options], rules).recipe
        for k in range(len(options[0].errors))
    ]
    return np.array([by_recipe[id(recipe)][k] for k, recipe in enumerate(chosen)])


def fitted(regression: Regression, recipe: Recipe) -> Model:
    """The recipe with its sizes."""
    model = regression.model(recipe.terms, recipe.free)
    if not recipe.output_error:
        return model
    sizes = _by_output_error(regression, model)
    return sizes if all(regression.possible(p, sizes) for p in model.free) else model


def _by_output_error(regression: Regression, model: Model) -> Model:
    """The model with sizes of least squared speed error in free runs, to first order, under the same priors
    and signs (Wahlberg and Ljung, IEEE Transactions on Automatic Control 31, 1986)."""
    counted = regression.series.valid
    if not counted.any():
        return model
    columns, prior, _ = regression.design(model)
    X = _added_up(regression, columns, counted)[counted]
    y = _added_up(regression, regression.series.y[:, None], counted)[counted, 0]
    length = max(1, round(Limits.horizons_s[0] / regression.e.dt))
    b = model.fit.b
    for _ in range(ROUNDS):
        left = max(float(np.mean((y - X @ b) ** 2)), regression.rules.noise_floor**2)
        b, _ = ridge(y, X, np.full(len(y), FREE_RUN_NUMBERS / (length * left)), prior)
    return replace(model, fit=replace(model.fit, b=b))


def _added_up(regression: Regression, x: Array, counted: Mask) -> Array:
    """Integral of x (n, k) over time, m/s, restarted every `horizons_s[0]` s; rows that are not counted add
    nothing."""
    length = max(1, round(Limits.horizons_s[0] / regression.e.dt))
    x, out = np.where(counted[:, None], np.nan_to_num(x), 0.0), np.empty_like(x)
    for s in regression.e.drives:
        for begin in range(s.start, s.stop, length):
            rows = slice(begin, min(begin + length, s.stop))
            out[rows] = np.cumsum(x[rows], axis=0) * regression.e.dt
    return out


def _acts(regression: Regression, model: Model) -> Array:
    """Acceleration (n,) that a correction adds: terms and free parameters, without nuisance terms."""
    X, _, layout = regression.design(model)
    out = np.zeros(len(regression.e))
    for name, part in layout:  # parameters too: all is linearised about others than those given
        if name in model.effects or name.startswith("parameter:"):
            out += np.nan_to_num(X[:, part]) @ model.fit.b[part]
    return out
