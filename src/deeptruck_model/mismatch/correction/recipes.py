"""What may go into the corrected simulator, and which of it drives best.

A recipe is fitted to some of the recordings and driven free along others that are not held out.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from deeptruck_model.mismatch.correction import output_error
from deeptruck_model.mismatch.correction.corrected_truck import CorrectedTruck, Term
from deeptruck_model.mismatch.correction.improvement import HORIZONS_S, free_runs, joined
from deeptruck_model.mismatch.data.prepared import Prepared
from deeptruck_model.mismatch.fit_result import Chosen, Errors
from deeptruck_model.mismatch.mechanisms import CandidateTerm, held_steady, is_time_varying
from deeptruck_model.mismatch.mechanisms.carriers import factors
from deeptruck_model.mismatch.posterior.causes import Explanation
from deeptruck_model.mismatch.posterior.linearised import accepted
from deeptruck_model.mismatch.posterior.search import PINNED, Model, Search
from deeptruck_model.mismatch.residual.components import Shares
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.rules import Rules
from deeptruck_model.simulators import Simulator

Mask = NDArray[np.bool_]

FOLDS = 3  # of the recordings that are not held out, to choose what goes in


@dataclass(frozen=True)
class Fold:
    """The recordings that are fitted, and those that are driven."""

    search: Search
    driven: tuple[Prepared, ...]


@dataclass(frozen=True)
class Recipe:
    """What is fitted, and which of it goes into the simulator: mechanisms, and parameters by name."""

    fitted: tuple[CandidateTerm, ...]
    kept: tuple[CandidateTerm, ...]
    free: frozenset[str]
    what: Chosen = Chosen.FINDINGS
    for_driving: bool = False  # sizes that drive best instead of the most probable ones

    def corrected(self, simulator: Simulator, search: Search, shares: Shares | None) -> CorrectedTruck:
        model = search.model(self.fitted, self.free)
        if self.for_driving:
            sizes = output_error.refitted(search, model, HORIZONS_S[0])
            model = sizes if all(search.possible(p, sizes) for p in self.free) else model
        change = _change(search.e, model, self.free)
        return _truck(simulator, search.e, _terms(self.kept, model), change, shares)


class Trials:
    """Free runs of recipes along recordings that are not held out, each driven once."""

    def __init__(
        self,
        simulator: Simulator,
        folds: Sequence[Fold],
        shares: Shares | None,
        rules: Rules,
        horizon_s: float,
    ) -> None:
        self._simulator, self.folds, self.shares, self._rules = simulator, folds, shares, rules
        self.crossed = len(folds) == FOLDS  # along recordings that a fit has not seen
        self._horizon_s = horizon_s
        self._driven: dict[int, tuple[Recipe, Errors]] = {}

    def errors(self, recipes: Sequence[Recipe]) -> list[Errors]:
        """Of each; those that are not driven yet go in one batch."""
        new = list({id(r): r for r in recipes if id(r) not in self._driven}.values())
        folds = self.folds
        jobs = [(r.corrected(self._simulator, f.search, self.shares), f.driven) for r in new for f in folds]
        driven = free_runs(jobs, self._horizon_s)
        for k, recipe in enumerate(new):
            self._driven[id(recipe)] = recipe, joined(driven[k * len(folds) : (k + 1) * len(folds)])
        return [self._driven[id(r)][1] for r in recipes]

    def squares(self, recipes: Sequence[Recipe]) -> list[float]:
        """Mean square of the speed error of each: by it goes in what helps some drives much, though others
        gain nothing. Whether that is better is judged by the mean of runs."""
        if not self.folds:
            return [0.0] * len(recipes)
        return [float(np.mean(e.speed**2)) if len(e.speed) else 0.0 for e in self.errors(recipes)]

    def with_better_sizes(self, recipes: Sequence[Recipe]) -> list[Recipe]:
        """Each with its most probable sizes, or with those fitted to free runs where these drive better along
        what neither was fitted to. Along what they were fitted to they always do."""
        if not self.crossed:
            return list(recipes)
        fitted = {id(r): replace(r, for_driving=True) for r in recipes if r.fitted or r.free}
        others = [fitted.get(id(r), r) for r in recipes]
        squares = self.squares([*recipes, *others])
        better = [
            new < self._rules.no_better**2 * old
            for old, new in zip(squares[: len(recipes)], squares[len(recipes) :], strict=True)
        ]
        return [other if b else r for r, other, b in zip(recipes, others, better, strict=True)]


def recipes_of(e: Evidence, x: Explanation) -> list[Recipe]:
    """What is time-varying with its mean, held steady or left out, each with all moved parameters, with the
    stated ones alone and with none. Beside what belongs to a place, parameters that nobody states as wrong
    stay: elsewhere nothing would make up for them."""
    stated = [c.term for c in x.causes if c.term is not None]
    told = [s for s in _physics(x.model.named) if any(s is t for t in stated)]
    lasting = [s for s in told if not is_time_varying(s)]
    parameters = frozenset(c.effect for c in x.causes if c.kind == "parameter_error")
    at_places = any(s.variant.comes_again for s in told)
    moved = {parameters & x.model.free, frozenset()} | (set() if at_places else {x.model.free})
    out = []
    for free in sorted(moved, key=lambda f: -len(f)):
        out.append(Recipe(x.model.named, tuple(told), free))
        if len(lasting) < len(told):
            held = tuple(held_steady(s, e) for s in x.model.named)
            keep = tuple(h for h, s in zip(held, x.model.named, strict=True) if any(s is t for t in told))
            out += [Recipe(x.model.named, tuple(lasting), free), Recipe(held, keep, free)]
    return out


def with_laws(x: Explanation) -> Recipe | None:
    """All names and all laws beside them, with every parameter as it was moved."""
    if x.lawful is None:
        return None
    return Recipe(x.lawful.named, _physics(x.lawful.named), x.lawful.free, Chosen.LAWS)


def holds(recipe: Recipe, x: Explanation) -> bool:
    """Whether all that was found is in it: every force, every wrong parameter, and laws where these are what
    was found."""
    forces = {c.acts_as for c in x.causes if c.term is not None and c.kind == "missing_physics"}
    wrong = {c.effect for c in x.causes if c.kind == "parameter_error"}
    lawful = x.lawful is not None and any(c.predictable for c in x.causes)
    within = forces <= {k.mechanism.effect for k in recipe.kept} and wrong <= recipe.free
    return within and (not lawful or recipe.what is Chosen.LAWS)


def best_of(recipes: Sequence[Recipe], squares: Sequence[float], own: bool) -> Recipe:
    """Which drives best. Laws join names only where these drive better than parameters without them: laws are
    no proof of names. Where they are a finding of their `own` they need none."""
    order = [int(k) for k in np.argsort(squares)]
    plain = next(k for k in order if recipes[k].what is not Chosen.LAWS)
    return recipes[order[0] if own or recipes[plain].what is Chosen.FINDINGS else plain]


def corrected(simulator: Simulator, e: Evidence, model: Model) -> CorrectedTruck:
    """The simulator with one whole explanation in it, parameters and all; of a physics truck."""
    change = _change(e, model, model.free)
    terms = _terms(_physics(model.named), model)
    return _truck(simulator, e, terms, change, Shares.untold(e))


def _truck(
    simulator: Simulator, e: Evidence, terms: Sequence[Term], change: dict[str, float], shares: Shares | None
) -> CorrectedTruck:
    change = accepted(simulator, change)
    return CorrectedTruck(simulator, terms, change, shares, False, e.gears, factors(e.moved, change))


def _physics(terms: Iterable[CandidateTerm]) -> tuple[CandidateTerm, ...]:
    return tuple(s for s in terms if s.mechanism.kind == "missing_physics")


def _terms(terms: Sequence[CandidateTerm], model: Model) -> list[Term]:
    return [
        Term(s.mechanism.effect, s.variant, tuple(model.coefficients(s.mechanism.effect).tolist()))
        for s in terms
    ]


def _change(e: Evidence, model: Model, free: Iterable[str]) -> dict[str, float]:
    return {p: float(np.clip(e.total_change(p, model.moved(p)), *e.vehicle.possible(p))) for p in free}


def folds_of(e: Evidence, prepared: Sequence[Prepared]) -> list[Fold]:
    """Parts of the recordings that are not held out, each to be driven by a fit to the others; all by a fit
    to all, where they are few."""
    fitted = np.flatnonzero([not s.held_out for s in e.stretches])
    parts = [fitted[k::FOLDS] for k in range(FOLDS)] if len(fitted) >= 2 * FOLDS else []
    out = []
    for away in parts or [np.array([], dtype=int)]:
        search = as_given(e, ~e.held_out & ~np.isin(e.record, away))
        drives = [p for k, p in zip(fitted, prepared, strict=True) if not parts or k in away]
        out.append(Fold(search, tuple(drives)))
    return out


def as_given(e: Evidence, only: Mask) -> Search:
    """A search in which parameters that are not corrected stay as given: the others fit beside them so."""
    return Search(e, only=only, held=PINNED)
