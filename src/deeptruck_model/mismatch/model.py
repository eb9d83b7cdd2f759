"""The corrected simulator: for every name the form that explains most, and parameters, as they drive best.

Everything is fitted and chosen without the held-out recordings, by speed errors of free runs to first order.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from deeptruck_model.mismatch.classify import Names
from deeptruck_model.mismatch.correction.corrected_truck import CorrectedTruck, Term
from deeptruck_model.mismatch.fit_result import Refitted
from deeptruck_model.mismatch.gains import gain_of, screened
from deeptruck_model.mismatch.mechanisms import LIBRARY, CandidateTerm, is_time_varying, merge
from deeptruck_model.mismatch.mechanisms.carriers import factors
from deeptruck_model.mismatch.posterior.regression import PINNED, Model, Regression
from deeptruck_model.mismatch.report.wording import PARAMETER_UNITS
from deeptruck_model.mismatch.residual.components import Shares
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.residual.noise import Z95, ridge, whiten
from deeptruck_model.mismatch.residual.sensitivity import accepted
from deeptruck_model.mismatch.rules import Rules
from deeptruck_model.mismatch.tree import FAMILY, UNKNOWN
from deeptruck_model.simulators import Simulator

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

FOLDS = 3
HORIZON_S = 40.0  # of the free runs that sizes are fitted to
FITTED = 3  # forms of a name that are fitted in full
WIDER = 2  # further forms by which a term may be widened
FEW = 8  # columns of a term that is confined to a regime, or widens another
LEAST_PART = 0.15  # of a term's squares that must lie in its regime
ROUNDS = 4  # of weighing the prior against what is left
LOWEST = -0.99  # relative change of a parameter: none has no size
FREE_RUN_NUMBERS = 2.0  # independent numbers in a free run's error: its offset and its curvature


@dataclass(frozen=True)
class Recipe:
    """What is fitted: `terms` and `free` parameters, with sizes by evidence or by `output_error`."""

    terms: tuple[CandidateTerm, ...] = ()
    free: frozenset[str] = frozenset()
    output_error: bool = False


@dataclass(frozen=True)
class Made:
    """The corrected simulator and the one with parameters refitted alone; the recipe, and its most probable
    sizes, which findings state whatever sizes drive best; and the parameters that were refitted alone."""

    corrected: CorrectedTruck
    tuned: CorrectedTruck
    recipe: Recipe
    fit: Model
    refit: Mapping[str, Refitted] = field(default_factory=dict)


def correct(simulator: Simulator, search: Regression, names: Names, rules: Rules) -> Made:
    """The correction by what was named."""
    terms = _terms(search, names, rules)
    parameters = frozenset(search.parameters)
    accepted = [n for n in names.found if n.accepted]
    stated = frozenset(n.name for n in accepted) & parameters
    tuning = Recipe((), parameters)
    options = [Recipe(), tuning]
    if terms or accepted:
        frees = {stated, parameters, frozenset[str]()} if terms else {stated, parameters}
        options += [Recipe(terms, free) for free in sorted(frees, key=len)]
        options += [replace(o, output_error=True) for o in options[1:]]
    folds = _folds(search.e)
    errors = [_left_out(folds, recipe) for recipe in options]
    best = options[int(np.argmin([e if k else rules.better**2 * e for k, e in enumerate(errors)]))]
    whole = Regression(search.e.everywhere(), only=~search.e.held_out & search.e.valid, held=PINNED)
    alone = whole.model((), parameters)
    return Made(
        _truck(simulator, whole, best, _fitted(whole, best)),
        _truck(simulator, whole, tuning, _fitted(whole, tuning)),
        best,
        whole.model(best.terms, best.free),
        {p: _refitted(simulator, whole.e, alone, p) for p in sorted(alone.free)},
    )


def _refitted(simulator: Simulator, e: Evidence, model: Model, parameter: str) -> Refitted:
    """A parameter's change from the simulator as given, with its interval."""
    given = simulator.parameters().get(parameter)
    wide = Z95 * (1.0 + e.moved.get(parameter, 0.0)) * model.moved_sd(parameter)
    change = e.total_change(parameter, model.moved(parameter))
    low, high = (max(change + side * wide, LOWEST) for side in (-1.0, 1.0))
    if given is None:
        return Refitted(change, (low, high))
    value, *ci95 = (given * (1.0 + x) for x in (change, low, high))
    return Refitted(change, (low, high), PARAMETER_UNITS.get(parameter, "1"), value, (ci95[0], ci95[1]))


def _terms(search: Regression, names: Names, rules: Rules) -> tuple[CandidateTerm, ...]:
    """A term for everything that was named, `unknown` included: the form that explains most among the names
    of its credible set that are of the family of the most probable one."""
    out: tuple[CandidateTerm, ...] = ()
    parameters = frozenset(search.parameters)
    for named in names.found:
        first = named.name
        if first == UNKNOWN:  # it is corrected by what resembles it most
            first = max((n for n in named.tree.names if n != UNKNOWN), key=named.tree.names.__getitem__)
        if first in parameters:
            continue
        credible = {first, *named.tree.credible(rules.credible)}
        family = [m for m in search.library if m.effect in credible and FAMILY[m.effect] == FAMILY[first]]
        family = [
            m
            for m in family
            if m.kind == "missing_physics" and m.effect not in {t.mechanism.effect for t in out}
        ]
        options = [t for m in family for t in search.candidate_terms(m)]
        if options:
            out = (*out, _best_of(search, out, options))
    return out


def _best_of(
    search: Regression, others: tuple[CandidateTerm, ...], options: Sequence[CandidateTerm]
) -> CandidateTerm:
    """The term with the most evidence beside others, perhaps in one regime alone or of several forms."""
    free = frozenset(search.parameters)
    base = search.model(others, free)
    first = screened(search, base, base, options)[:FITTED]
    fitted = [search.model((*others, t), free, base.fit) for t in first]
    leader = max(fitted, key=lambda m: m.score)
    again = [t for t in screened(search, base, leader, options)[:FITTED] if not any(t is s for s in first)]
    best = max(
        [leader, *(search.model((*others, t), free, leader.fit) for t in again)], key=lambda m: m.score
    )
    best = max(
        [best, *(search.model((*others, t), free, best.fit) for t in _gated(search, base, best))],
        key=lambda m: m.score,
    )
    for _ in range(WIDER):
        last = best.named[-1]
        if is_time_varying(last):
            break
        more = [
            merge(last, t)
            for t in search.candidate_terms(last.mechanism)
            if t.variant not in last.variant.parts and t.columns.shape[1] <= FEW and not is_time_varying(t)
        ]
        rest = screened(search, base, best, more)[:FITTED]
        wider = max(
            (search.model((*others, t), free, best.fit) for t in rest), key=lambda m: m.score, default=best
        )
        if wider.score < best.score + search.rules.temper:
            break
        best = wider
    return best.named[-1]


def _gated(search: Regression, base: Model, model: Model) -> list[CandidateTerm]:
    """The last term of a model confined to one side of a border, the best two."""
    term = model.named[-1]
    if (
        not term.mechanism.confinable
        or term.variant.gate
        or term.columns.shape[1] > FEW
        or is_time_varying(term)
    ):
        return []
    if any(p.expression.__class__.__name__ == "Rerun" for p in term.parts):
        return []
    yw, Xw, H0, weight = search.whitened(base, model)
    C = whiten(term.columns, model.fit.ar, search.rows, weight)
    gates, products = search.regimes.products(C, yw, Xw)
    if not gates:
        return []
    gains = gain_of(products, Xw.T @ yw, H0, term)
    part = np.trace(products.CtC, axis1=1, axis2=2) > LEAST_PART * float(np.sum(C**2))
    best = [k for k in np.argsort(-gains, kind="stable") if part[k]][:2]
    return [search.regimes.gated(term, gates[k], search.e) for k in best]


@dataclass(frozen=True)
class _Fold:
    """A search on some of the fitted drives, and the rows (n,) of the others."""

    search: Regression
    left_out: Mask


def _folds(e: Evidence) -> list[_Fold]:
    """Parts of the fitted drives left out in turn; all of them fitted and driven where they are few."""
    fitted = np.flatnonzero([not s.held_out for s in e.stretches])
    parts = [fitted[k::FOLDS] for k in range(FOLDS)] if len(fitted) >= FOLDS else []
    if not parts:
        return [_Fold(Regression(e, held=PINNED), e.valid & ~e.held_out)]
    out = []
    for away in parts:
        there = np.isin(e.record, away)
        out.append(_Fold(Regression(e, only=e.valid & ~e.held_out & ~there, held=PINNED), e.valid & there))
    return out


def _left_out(folds: Sequence[_Fold], recipe: Recipe) -> float:
    """Mean square of the speed error, to first order, along drives that the recipe was not fitted to."""
    total, count = 0.0, 0
    for fold in folds:
        s = fold.search
        model = _fitted(s, recipe)
        left = s.e.residual - _acts(s, model)
        speed = _added_up(s, left[:, None], fold.left_out)[fold.left_out, 0]
        total, count = total + float(speed @ speed), count + len(speed)
    return total / max(count, 1)


def _acts(search: Regression, model: Model) -> Array:
    """What a correction adds (n,): its terms and the parameters that are free, without sensors' lateness."""
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
    """The model with the sizes of least squared speed error in free runs, to first order, under the same
    priors and signs (Wahlberg and Ljung, IEEE Transactions on Automatic Control 31, 1986)."""
    counted = search.series.valid
    if not counted.any():
        return model
    columns, prior, _ = search.design(model)
    X = _added_up(search, columns, counted)[counted]
    y = _added_up(search, search.series.y[:, None], counted)[counted, 0]
    length = max(1, round(HORIZON_S / search.e.dt))
    b = model.fit.b
    for _ in range(ROUNDS):
        left = max(float(np.mean((y - X @ b) ** 2)), search.rules.noise_floor**2)
        b, _ = ridge(y, X, np.full(len(y), FREE_RUN_NUMBERS / (length * left)), prior)
    return replace(model, fit=replace(model.fit, b=b))


def _added_up(search: Regression, x: Array, counted: Mask) -> Array:
    """Sums of x (n, k) over time, m/s, that begin anew every HORIZON_S; other rows add nothing."""
    length = max(1, round(HORIZON_S / search.e.dt))
    x, out = np.where(counted[:, None], np.nan_to_num(x), 0.0), np.empty_like(x)
    for s in search.e.stretches:
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
        Term(t.mechanism.effect, t.variant, tuple(model.coefficients(t.mechanism.effect).tolist()))
        for t in recipe.terms
        if t.mechanism.effect in LIBRARY
    ]
    return CorrectedTruck(
        simulator, terms, change, Shares.if_unreported(e), False, e.gears, factors(e.moved, change)
    )
