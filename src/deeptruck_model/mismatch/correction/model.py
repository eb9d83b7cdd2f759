"""The corrected simulator: the forces of names, and what is fitted beside them.

The force of a name has the sizes of the draws as its prior and is fitted beside the others, and its finding
states it so. Of names, of forces without one, and of parameters a correction has what lowers the speed error
of fitted drives that are left out in turn, to first order.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations

import numpy as np

from deeptruck_core.arrays import Array, Mask
from deeptruck_model.mismatch.correction.corrected_truck import CorrectedTruck, Term, factors
from deeptruck_model.mismatch.correction.fit_result import Interval, Refitted
from deeptruck_model.mismatch.correction.forms import (
    NamedForce,
    named_forces,
    nameless_terms,
    simplest_terms,
)
from deeptruck_model.mismatch.mechanisms import LIBRARY, CandidateTerm
from deeptruck_model.mismatch.mechanisms.families import FAMILY, PARAMETER_ERRORS, UNKNOWN
from deeptruck_model.mismatch.posterior.names import Compared, Named
from deeptruck_model.mismatch.posterior.posterior import Posterior
from deeptruck_model.mismatch.posterior.regression import FREE, PINNED, Model, Regression
from deeptruck_model.mismatch.posterior.relinearise import about_the_mean
from deeptruck_model.mismatch.residual.components import Shares
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.residual.gather import accepted
from deeptruck_model.mismatch.residual.noise import Z95, ridge
from deeptruck_model.mismatch.rules import Limits, Rules
from deeptruck_model.recordings import Recording
from deeptruck_model.simulators import Simulator

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

    @property
    def names(self) -> set[str]:
        """Effects and parameters in it."""
        return {*(t.mechanism.effect for t in self.terms), *self.free}

    def without(self, name: str) -> Recipe:
        """The same without an effect or a parameter."""
        terms = tuple(t for t in self.terms if t.mechanism.effect != name)
        return replace(self, terms=terms, free=self.free - {name})


@dataclass(frozen=True)
class Added:
    """A force that a correction adds (n,), m/s^2, as its finding states it, and how much larger it is than
    the mean of the draws (`factor`)."""

    force: Array
    factor: float = 1.0


@dataclass(frozen=True)
class Correction:
    """The corrected simulator, the one with refitted parameters only, and what they hold: `forces` added by
    name, all that has no name as `unknown`, and parameters `changed` and of the `refit`. `terms` are one form
    of each mechanism that may act, whose sizes findings state.

    `left_out` are first-order speed errors (drives,), rms in m/s, of fitted drives that were left out in
    turn, by simulator as in `FreeRunErrors`; empty if they are too few. Those of the corrected
    simulator are of the recipe that the other drives select. `needless` are found names without which drives
    left out are predicted as well.
    """

    corrected: CorrectedTruck
    parameters_only: CorrectedTruck
    output_error: bool = False
    forces: Mapping[str, Added] = field(default_factory=dict)
    changed: Mapping[str, Refitted] = field(default_factory=dict)
    refit: Mapping[str, Refitted] = field(default_factory=dict)
    terms: tuple[CandidateTerm, ...] = ()
    left_out: Mapping[str, Array] = field(default_factory=dict)
    caveats: tuple[str, ...] = ()
    needless: frozenset[str] = frozenset()


def correct(simulator: Simulator, c: Compared) -> Correction:
    """The correction by all blocks of the posterior, named or not, with the simulator at the posterior mean
    of its parameters."""
    p, rules = c.posterior, c.search.rules
    likely = _stated_changes(c)
    e = about_the_mean(simulator, c.drives, c.given, p, likely)
    named = named_forces(p, c.names.found, e)
    tuning, folds = Recipe((), frozenset(p.search.parameters)), _folds(e)
    needless = _needless(folds, Recipe(_terms(named), frozenset(likely)), c.names.found, rules.stated)
    named = {name: x for name, x in named.items() if name not in needless}
    likely = {name: x for name, x in likely.items() if name not in needless}
    options, errors = [Recipe()], [_left_out(folds, Recipe())]
    for whole in _wholes(p, named, frozenset(likely), e):
        for recipe, own in _pruned(folds, whole, p.probability, rules):
            options.append(recipe)
            errors.append(own)
    for recipe, own in _subsets(folds, p.search.parameters):
        options.append(recipe)
        errors.append(own)
    left_out = {
        "before": errors[0],
        "parameters_only": _left_out(folds, tuning),
        "after": _nested(options, errors, rules),
    }
    best = options[_best(options, errors, rules)]
    search = Regression(e.everywhere(), only=~e.held_out & e.valid, parameter_sd=PINNED)
    alone, fitted = _fitted(search, tuning), _fitted(search, best)
    by_evidence = search.model((), tuning.free)
    return Correction(
        _truck(simulator, search, fitted),
        _truck(simulator, search, alone),
        best.output_error,
        _added(fitted, named),
        {n: _refitted(simulator, search.e, fitted, n) for n in sorted(fitted.free)},
        {n: _refitted(simulator, search.e, by_evidence, n) for n in sorted(by_evidence.free)},
        tuple(simplest_terms(p, e)),
        {name: np.array([_rms(drive[None]) for drive in own]) for name, own in left_out.items()}
        if len(folds) > 1
        else {},
        tuple(_contradicted_mass(c, best)),
        needless,
    )


def _needless(
    folds: Sequence[_Fold], recipe: Recipe, found: Sequence[Named], stated: float
) -> frozenset[str]:
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
    errors = _left_out(folds, recipe)
    for name in (f.name for f in reversed(found) if f.name in recipe.names):
        less = recipe.without(name)
        if less.names and _rms(without := _left_out(folds, less)) <= _rms(errors):
            recipe, errors = less, without
            out.add(name)
    return frozenset(out)


def _stated_changes(c: Compared) -> dict[str, float]:
    """The relative changes of parameters that are found, from the simulator as given, in the draws."""
    p, e = c.posterior, c.search.e
    return {
        f.name: float(np.clip(p.change(f.name, f.given)[0], *e.vehicle.possible(f.name)))
        for f in c.names.found
        if f.accepted and f.lasts and p.is_parameter(f.name)
    }


def _terms(named: Mapping[str, NamedForce]) -> tuple[CandidateTerm, ...]:
    return tuple(one.term for one in named.values())


def _wholes(
    p: Posterior, named: Mapping[str, NamedForce], likely: frozenset[str], e: Evidence
) -> Iterator[Recipe]:
    """Recipes from which parts are omitted: what was found, alone, with what has no name, and with all
    parameters."""
    known = _terms(named)
    rest = tuple(nameless_terms(p, {*named, *likely}, e))
    everything = frozenset(p.search.parameters)
    wholes = [(known, likely), ((*known, *rest), likely)]
    if known or rest:
        wholes.append(((*known, *rest), everything))
    for terms, free in wholes[1:] if not rest else wholes:
        if terms or free:
            yield from (Recipe(terms, free, by_output_error) for by_output_error in (False, True))


def _added(model: Model, named: Mapping[str, NamedForce]) -> dict[str, Added]:
    """The forces of a model by name, what has no name together."""
    out: dict[str, Added] = {}
    for term in model.named:
        effect = term.mechanism.effect
        sizes = model.coefficients(effect)
        force = term.columns @ sizes
        if effect in named:
            out[effect] = Added(force, named[effect].factor(sizes))
        else:
            out[UNKNOWN] = Added(out[UNKNOWN].force + force if UNKNOWN in out else force)
    return out


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
    for part in sorted(sorted(recipe.names), key=probability):  # of equal ones, in any process the same
        less = recipe.without(part)
        if less.names and _rms(without := _left_out(folds, less)) <= most:
            recipe = less
            yield less, without


def _subsets(folds: Sequence[_Fold], parameters: Sequence[str]) -> Iterator[tuple[Recipe, Array]]:
    """Recipes of parameters alone, every subset, and the best of each size by output error; with their errors
    as of `_left_out`. Pruning misses pairs: more mass is the same as less torque, brake and drag together."""
    for count in range(1, len(parameters) + 1):
        recipes = [Recipe((), frozenset(free)) for free in combinations(parameters, count)]
        each = [(recipe, _left_out(folds, recipe)) for recipe in recipes]
        yield from each
        best = replace(min(each, key=lambda x: _rms(x[1]))[0], output_error=True)
        yield best, _left_out(folds, best)


def _best(options: Sequence[Recipe], errors: Sequence[Array], rules: Rules) -> int:
    """Of the recipes whose error is nearly the least, beside noise of speed, the one with the fewest
    coefficients. Errors are those of `_left_out`."""
    each = np.hypot([_rms(e) for e in errors], Limits.speed_noise)
    near = np.flatnonzero(each <= each.min() / rules.better)
    return int(min(near, key=lambda k: (options[k].coefficients, each[k])))


def _nested(options: Sequence[Recipe], errors: Sequence[Array], rules: Rules) -> Array:
    """Errors of every drive (drives, 2) by the recipe that is best on the others (nested choice): one
    that was chosen on all drives would be judged too well on each."""
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


def _truck(simulator: Simulator, search: Regression, model: Model) -> CorrectedTruck:
    e = search.e
    change = {
        p: float(np.clip(e.total_change(p, model.moved(p)), *e.vehicle.possible(p)))
        for p in sorted(model.free)
    }
    change = accepted(simulator, change)
    terms = [
        Term(effect, t.variants, tuple(model.coefficients(effect).tolist()))
        for t in model.named
        if (effect := t.mechanism.effect) in LIBRARY
    ]
    return CorrectedTruck(
        simulator, terms, change, Shares.if_unreported(e), False, e.gears, factors(e.moved, change)
    )


def contradicted_mass(recordings: Sequence[Recording], mass_kg: float, ci95_kg: Interval) -> Iterator[str]:
    """Remarks on recorded masses outside the interval `ci95_kg` that the drives give, kg."""
    low, high = ci95_kg
    for r in recordings:
        if r.interface.mass_kg is not None and not low <= r.interface.mass_kg <= high:
            yield (
                f"{r.name} states a mass of {r.interface.mass_kg / 1000:.1f} t, and the drives show "
                f"{mass_kg / 1000:.1f} t ({low / 1000:.1f} to {high / 1000:.1f}, 95 %)"
            )
            return
