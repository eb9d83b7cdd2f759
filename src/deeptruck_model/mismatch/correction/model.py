"""The corrected simulator: refitted parameters, and the posterior mean force as terms that run step by step.

The posterior determines which forms of a mechanism represent its mean force, with or without a name. Sizes
are fitted and selected on the fitted recordings alone, by the speed errors of free runs to first order.
"""

from __future__ import annotations

import functools
import itertools
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from deeptruck_model.mismatch.comparison import Compared
from deeptruck_model.mismatch.correction.corrected_truck import CorrectedTruck, Term
from deeptruck_model.mismatch.fit_result import Refitted
from deeptruck_model.mismatch.mechanisms import LIBRARY, CandidateTerm, candidate_term, confined, merge
from deeptruck_model.mismatch.mechanisms.carriers import factors
from deeptruck_model.mismatch.mechanisms.courses import ALWAYS, conditions
from deeptruck_model.mismatch.mechanisms.others import PARAMETER_ERRORS
from deeptruck_model.mismatch.mechanisms.record import Mechanism
from deeptruck_model.mismatch.posterior.kernels import CONDITIONAL
from deeptruck_model.mismatch.posterior.posterior import Posterior
from deeptruck_model.mismatch.posterior.regression import FREE, PINNED, Model, Regression
from deeptruck_model.mismatch.posterior.relinearise import about_the_mean
from deeptruck_model.mismatch.residual.components import Shares
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.residual.noise import Z95, ridge
from deeptruck_model.mismatch.residual.sensitivity import accepted
from deeptruck_model.mismatch.rules import Limits, Rules
from deeptruck_model.mismatch.strength import Strength, strength
from deeptruck_model.mismatch.tree import UNKNOWN
from deeptruck_model.mismatch.unrecorded import contradicted_mass
from deeptruck_model.simulators import Simulator

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

FOLDS = 3
ROUNDS = 4  # of weighing the prior against what is left
LOWEST = -0.99  # relative change of a parameter: none has no size
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


@dataclass(frozen=True)
class Made:
    """The corrected simulator, the one with refitted parameters only, the recipe of the correction, one form
    of each mechanism that may act (`terms`), whose sizes findings state, and the parameters of the refit.

    `left_out` are first-order speed errors (drives,), rms in m/s, of fitted drives that were left out in
    turn, by simulator as in `FreeRunErrors`; empty if they are too few. Those of the corrected
    simulator are of the recipe that the other drives select.
    """

    corrected: CorrectedTruck
    parameters_only: CorrectedTruck
    recipe: Recipe
    refit: Mapping[str, Refitted] = field(default_factory=dict)
    terms: tuple[CandidateTerm, ...] = ()  # forms of all that may be in, of single drives too
    left_out: Mapping[str, Array] = field(default_factory=dict)
    added: Mapping[str, Strength] = field(default_factory=dict)  # by the correction, along the fitted drives
    caveats: tuple[str, ...] = ()


def correct(simulator: Simulator, c: Compared) -> Made:
    """The correction by all blocks of the posterior, named or not, fitted with the simulator at the posterior
    mean of its parameters."""
    p, rules = c.posterior, c.search.rules
    e = about_the_mean(simulator, c.drives, c.given, p)
    terms, stated = ([_anew(t, e) for t in _terms(p, general=general)] for general in (True, False))
    parameters = frozenset(p.search.parameters)
    likely = frozenset(n for n in parameters if p.inside(n).mean() >= rules.named)
    tuning = Recipe((), parameters)
    folds = _folds(e)
    options, errors = [Recipe()], [_left_out(folds, Recipe())]
    if terms or likely:
        for free in dict.fromkeys((likely, parameters) if terms else (likely,)):
            for output_error in (False, True):
                whole = Recipe(tuple(terms), free, output_error)
                for recipe, own in _pruned(folds, whole, p.probability, rules):
                    options.append(recipe)
                    errors.append(own)
    tuned = _left_out(folds, tuning)
    best = options[_best(options, errors, rules)]
    search = Regression(e.everywhere(), only=~e.held_out & e.valid, parameter_sd=PINNED)
    alone = search.model((), parameters)
    corrected = _truck(simulator, search, best, _fitted(search, best))
    added = {t.effect: np.array(t.coefficients) for t in corrected.terms}
    return Made(
        corrected,
        _truck(simulator, search, tuning, _fitted(search, tuning)),
        best,
        {n: _refitted(simulator, search.e, alone, n) for n in sorted(alone.free)},
        tuple(stated),
        {
            name: np.array([_rms(drive[None]) for drive in own])
            for name, own in (
                ("before", errors[0]),
                ("parameters_only", tuned),
                ("after", _nested(options, errors, rules)),
            )
            if len(folds) > 1
        },
        {
            term.mechanism.effect: strength(c.fitted, np.nan_to_num(term.columns) @ sizes)
            for term in best.terms
            if (sizes := added.get(term.mechanism.effect)) is not None
        },
        tuple(_contradicted_mass(c, best)),
    )


def _contradicted_mass(c: Compared, recipe: Recipe) -> Iterator[str]:
    """Remark on a stated mass that the drives contradict when all parameters are fitted with the
    terms of the correction."""
    model = c.search.model(recipe.terms, frozenset(c.search.parameters))
    if "mass" not in c.parameters or "mass" not in model.free or model.moved_sd("mass") >= 0.5 * FREE["mass"]:
        return
    about = c.parameters["mass"] * (1.0 + c.search.e.moved.get("mass", 0.0))
    value, wide = about * (1.0 + model.moved("mass")), Z95 * about * model.moved_sd("mass")
    recordings = [p.recording for p in c.drives.part(held_out=False)]
    yield from contradicted_mass(recordings, value, (value - wide, value + wide))


def _anew(term: CandidateTerm, e: Evidence) -> CandidateTerm:
    """A term on other evidence."""
    first, *others = (candidate_term(term.mechanism, v, e) for v in term.variants)
    return functools.reduce(merge, others, first)


def _terms(p: Posterior, *, general: bool = False) -> tuple[CandidateTerm, ...]:
    """For every mechanism that may act, the few forms that add up to its mean force. `general` ones apply to
    other drives too; a correction contains only these, and forms of any mechanism that add up to the mean
    force that follows none."""
    picked: list[CandidateTerm] = []
    for m in p.search.library:
        if p.inside(m.effect).mean() >= Limits.least_in:
            options = _options(p, m, general=general)
            pick = _forms if general else _simplest
            picked += pick(p.search, options, p.force(m.effect, p.inside(m.effect))) if options else []
    if general and p.inside(UNKNOWN).mean() >= Limits.least_in:
        force = p.force(UNKNOWN, p.inside(UNKNOWN))
        own = [_options(p, m, general=True) for m in p.search.library]
        best = [t for options in own if options for t in _forms(p.search, options, force)]
        own_forms = {id(t) for t in picked}
        picked += [t for t in _forms(p.search, best, force) if id(t) not in own_forms] if best else []
    out: dict[str, CandidateTerm] = {}
    for term in picked:
        effect = term.mechanism.effect
        out[effect] = merge(out[effect], term) if effect in out else term
    return tuple(out.values())


def _options(p: Posterior, m: Mechanism, *, general: bool) -> list[CandidateTerm]:
    """Candidate terms of a mechanism; where it may act in one condition only, each of its laws in every
    condition too."""
    out = [t for t in p.search.candidate_terms(m) if not general or t.general]
    if p.part(m.effect, CONDITIONAL) >= Limits.least_in:
        laws = [t for t in out if t.variants[0].course == ALWAYS and not t.reruns]
        out += [confined(t, where, p.search.e) for t in laws for where in conditions(p.search.e)]
    return out


def _simplest(search: Regression, options: Sequence[CandidateTerm], force: Array) -> list[CandidateTerm]:
    """The candidate term with the fewest coefficients, among those that explain a force (n,) nearly as well
    as the best one, and of these the one whose coefficients are nearest their prior; findings state its
    sizes."""
    gram, pull, squares, own = _products(search, options, force)
    left = np.array([squares - _explained(gram, pull, a) for a in own])
    good = np.flatnonzero(left <= left.min() + Limits.simpler * squares)

    def far(k: int) -> float:
        off = (_solved(gram, pull, own[k]) - options[k].prior.mean) / np.maximum(options[k].prior.sd, 1e-12)
        return float(off @ off)

    return [options[min(good, key=lambda k: (len(own[k]), far(k)))]]


def _products(
    search: Regression, options: Sequence[CandidateTerm], force: Array
) -> tuple[Array, Array, float, list[NDArray[np.intp]]]:
    """Inner products of all columns of some terms, and of these with a force (n,); the force's sum of
    squares; and the columns of each term."""
    rows = search.rows
    widths = np.cumsum([0, *(t.columns.shape[1] for t in options)])
    X = np.concatenate([np.nan_to_num(t.columns[rows]) for t in options], axis=1)
    own = [np.arange(a, b) for a, b in itertools.pairwise(widths)]
    return X.T @ X, X.T @ force[rows], float(force[rows] @ force[rows]), own


def _forms(search: Regression, options: Sequence[CandidateTerm], force: Array) -> list[CandidateTerm]:
    """The few candidate terms that together explain most of a force (n,), by greedy selection."""
    gram, pull, squares, own = _products(search, options, force)
    taken: list[int] = []
    left = squares
    while len(taken) < Limits.most_forms and left > Limits.form_left * squares:
        errors = [
            squares - _explained(gram, pull, np.concatenate([own[i] for i in (*taken, k)]))
            for k in range(len(own))
        ]
        best = int(np.argmin(errors))
        if errors[best] > (1.0 - Limits.form_left) * left:
            break
        taken.append(best)
        left = errors[best]
    return [options[k] for k in taken]


def _explained(gram: Array, pull: Array, at: NDArray[np.intp]) -> float:
    """Explained sum of squares for some columns."""
    b = _solved(gram, pull, at)
    return float(2.0 * b @ pull[at] - b @ gram[np.ix_(at, at)] @ b)


def _solved(gram: Array, pull: Array, at: NDArray[np.intp]) -> Array:
    """Coefficients of some columns, with a small ridge."""
    H = gram[np.ix_(at, at)]
    out: Array = np.linalg.solve(H + np.eye(len(H)) * (1e-6 * np.trace(H) / len(H) + 1e-12), pull[at])
    return out


def _refitted(simulator: Simulator, e: Evidence, model: Model, parameter: str) -> Refitted:
    """A parameter's change from the simulator as given, with its interval."""
    given = simulator.parameters().get(parameter)
    wide = Z95 * (1.0 + e.moved.get(parameter, 0.0)) * model.moved_sd(parameter)
    change = e.total_change(parameter, model.moved(parameter))
    low, high = (max(change + side * wide, LOWEST) for side in (-1.0, 1.0))
    if given is None:
        return Refitted(change, (low, high))
    value, *ci95 = (given * (1.0 + x) for x in (change, low, high))
    return Refitted(change, (low, high), value, PARAMETER_ERRORS[parameter].unit, (ci95[0], ci95[1]))


@dataclass(frozen=True)
class _Fold:
    """A regression on some of the fitted drives, and the rows (n,) of the others."""

    search: Regression
    left_out: Mask


def _folds(e: Evidence) -> list[_Fold]:
    """Parts of the fitted drives that are left out in turn; if drives are too few, one fold that fits and
    tests all."""
    fitted = np.flatnonzero([not s.held_out for s in e.drives])
    parts = [fitted[k::FOLDS] for k in range(FOLDS)] if len(fitted) >= FOLDS else []
    if not parts:
        return [_Fold(Regression(e, parameter_sd=PINNED), e.valid & ~e.held_out)]
    out = []
    for away in parts:
        there = np.isin(e.record, away)
        out.append(
            _Fold(Regression(e, only=e.valid & ~e.held_out & ~there, parameter_sd=PINNED), e.valid & there)
        )
    return out


def _left_out(folds: Sequence[_Fold], recipe: Recipe) -> Array:
    """Squared speed errors ((m/s)^2, to first order) and their number, for every drive, by a recipe not
    fitted to it, (drives, 2)."""
    out = []
    for fold in folds:
        s = fold.search
        left = s.e.residual - _acts(s, _fitted(s, recipe))
        speed = np.where(fold.left_out, _added_up(s, left[:, None], fold.left_out)[:, 0], 0.0)
        for drive in np.unique(s.e.record[fold.left_out]):
            rows = s.e.record == drive
            out.append((float(speed[rows] @ speed[rows]), int(fold.left_out[rows].sum())))
    return np.array(out, dtype=float).reshape(-1, 2)


def _pruned(
    folds: Sequence[_Fold], recipe: Recipe, probability: Callable[[str], float], rules: Rules
) -> Iterator[tuple[Recipe, Array]]:
    """A recipe, and what is left of it as each term and each parameter, the least probable first, is omitted
    whose absence hardly raises the error of drives left out; each with its errors as of `_left_out`."""
    errors = _left_out(folds, recipe)
    yield recipe, errors
    most = _rms(errors) / rules.better
    parts = sorted({*(t.mechanism.effect for t in recipe.terms), *recipe.free})  # equal in every process
    for part in sorted(parts, key=probability):
        terms = tuple(t for t in recipe.terms if t.mechanism.effect != part)
        less = replace(recipe, terms=terms, free=recipe.free - {part})
        if (less.terms or less.free) and _rms(without := _left_out(folds, less)) <= most:
            recipe = less
            yield less, without


def _best(options: Sequence[Recipe], errors: Sequence[Array], rules: Rules) -> int:
    """Of the recipes whose error is nearly the least, beside noise of speed, the one with the fewest
    coefficients. Errors are those of `_left_out`."""
    each = np.hypot([_rms(e) for e in errors], Limits.speed_noise)
    near = np.flatnonzero(each <= each.min() / rules.better)
    return int(min(near, key=lambda k: (options[k].coefficients, each[k])))


def _nested(options: Sequence[Recipe], errors: Sequence[Array], rules: Rules) -> Array:
    """Errors of every drive (drives, 2) by the recipe that is best on the others: the one that is best on all
    is so on each by chance too."""
    drives = np.arange(len(errors[0]))
    return np.array([errors[_best(options, [e[drives != k] for e in errors], rules)][k] for k in drives])


def _rms(errors: Array) -> float:
    """Root mean square of drives' errors (drives, 2), m/s."""
    squares, count = errors.sum(axis=0)
    return float(np.sqrt(squares / max(count, 1.0)))


def _acts(search: Regression, model: Model) -> Array:
    """Acceleration (n,) that a correction adds: terms and free parameters, without nuisance terms."""
    X, _, layout = search.design(model)
    out = np.zeros(len(search.e))
    for name, part in layout:  # parameters too: all is linearised about others than those given
        if name in model.effects or name.startswith("parameter:"):
            out += np.nan_to_num(X[:, part]) @ model.fit.b[part]
    return out


def _fitted(search: Regression, recipe: Recipe) -> Model:
    model = search.model(recipe.terms, recipe.free)
    if not recipe.output_error:
        return model
    sizes = _by_output_error(search, model)
    return sizes if all(search.possible(p, sizes) for p in model.free) else model


def _by_output_error(search: Regression, model: Model) -> Model:
    """The model with sizes of least squared speed error in free runs, to first order, under the same priors
    and signs (Wahlberg and Ljung, IEEE Transactions on Automatic Control 31, 1986)."""
    counted = search.series.valid
    if not counted.any():
        return model
    columns, prior, _ = search.design(model)
    X = _added_up(search, columns, counted)[counted]
    y = _added_up(search, search.series.y[:, None], counted)[counted, 0]
    length = max(1, round(Limits.horizons_s[0] / search.e.dt))
    b = model.fit.b
    for _ in range(ROUNDS):
        left = max(float(np.mean((y - X @ b) ** 2)), search.rules.noise_floor**2)
        b, _ = ridge(y, X, np.full(len(y), FREE_RUN_NUMBERS / (length * left)), prior)
    return replace(model, fit=replace(model.fit, b=b))


def _added_up(search: Regression, x: Array, counted: Mask) -> Array:
    """Integral of x (n, k) over time, m/s, restarted every `horizons_s[0]` s; rows that are not counted add
    nothing."""
    length = max(1, round(Limits.horizons_s[0] / search.e.dt))
    x, out = np.where(counted[:, None], np.nan_to_num(x), 0.0), np.empty_like(x)
    for s in search.e.drives:
        for begin in range(s.start, s.stop, length):
            rows = slice(begin, min(begin + length, s.stop))
            out[rows] = np.cumsum(x[rows], axis=0) * search.e.dt
    return out


def _truck(simulator: Simulator, search: Regression, recipe: Recipe, model: Model) -> CorrectedTruck:
    e = search.e
    change = {
        p: float(np.clip(e.total_change(p, model.moved(p)), *e.vehicle.possible(p)))
        for p in sorted(model.free)
    }
    change = accepted(simulator, change)
    terms = [
        Term(t.mechanism.effect, t.variants, tuple(model.coefficients(t.mechanism.effect).tolist()))
        for t in recipe.terms
        if t.mechanism.effect in LIBRARY
    ]
    return CorrectedTruck(
        simulator, terms, change, Shares.if_unreported(e), False, e.gears, factors(e.moved, change)
    )
