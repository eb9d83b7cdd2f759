"""From an explanation to a corrected simulator: which terms and parameters go in, and what that improves.

Everything is fitted, and chosen, without the held-out recordings.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from deeptruck_model.mismatch.correction.corrected_truck import CorrectedTruck, Term
from deeptruck_model.mismatch.correction.improvement import compared, free_windows, improvement, joined
from deeptruck_model.mismatch.data.prepared import Prepared
from deeptruck_model.mismatch.fit_result import Chosen, Compared, Errors, FitResult, Improvement
from deeptruck_model.mismatch.mechanisms import CandidateTerm, held_steady, is_time_varying
from deeptruck_model.mismatch.mechanisms.carriers import factors
from deeptruck_model.mismatch.posterior.causes import Cause, Explanation
from deeptruck_model.mismatch.posterior.kernels import UNKNOWN
from deeptruck_model.mismatch.posterior.left_out import left_out, of_its_time
from deeptruck_model.mismatch.posterior.linearised import accepted
from deeptruck_model.mismatch.posterior.nuisances import left_beside
from deeptruck_model.mismatch.posterior.search import PINNED, Model, Search
from deeptruck_model.mismatch.residual.components import Shares
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.rules import Rules
from deeptruck_model.simulators import Simulator


def claimed(x: Explanation, fit: FitResult, rules: Rules = Rules()) -> bool:
    """Whether what was found is told: it is strong, or free runs chose a correction that holds it and this
    drives better on held-out recordings. What acts in windows of its own is shown by blocks of its own drives
    instead; what is slow by its size alone. Knots predict left-out blocks of slow noise too, so blocks claim
    nothing that is time-varying. Laws that overlap are each weak beside the others, and strong together."""
    if not x.causes or fit.errors is None or max(x.gained, *(c.gain for c in x.causes)) >= rules.clear:
        return True
    if any(c.needed is not None or _shown_in_windows(c) for c in x.causes):
        return True
    before, after = fit.errors.before.speed, fit.errors.after.speed
    held = fit.chosen in (Chosen.FINDINGS, Chosen.LAWS) or {c.acts_as for c in x.causes} <= {*fit.corrected}
    return held and after <= rules.no_better * before


def _shown_in_windows(c: Cause) -> bool:
    windowed = c.term is not None and c.term.variant.acts_in_windows
    return windowed and c.left_out is not None and c.left_out.shown


Mask = NDArray[np.bool_]

HORIZON_S = 20.0  # of free runs: of long ones there are too few for an interval
COMPARED = ("before", "parameters_only", "after")
FOLDS = 3  # of the recordings that are not held out, to choose what goes in


@dataclass(frozen=True)
class Corrections:
    """The simulator with its parameters re-tuned alone, with all that was found and has a name, and with laws
    for what has none beside (None where there are none).

    `crossed`: errors of free runs along the recordings that are not held out, each by a fit to others of
    them, by the names of COMPARED; none where they are few.
    """

    tuned: CorrectedTruck
    named: CorrectedTruck
    unnamed: CorrectedTruck | None
    crossed: dict[str, Errors] = field(default_factory=dict)
    chosen: Chosen = Chosen.FINDINGS  # what `named` holds

    def after(self, with_unnamed: bool) -> tuple[CorrectedTruck, Chosen]:
        """The corrected simulator, with laws for what has no name where these are asked for and there."""
        if with_unnamed and self.unnamed is not None and self.chosen is not Chosen.LAWS:
            return self.unnamed, Chosen.LAWS
        return self.named, self.chosen


@dataclass(frozen=True)
class _Fold:
    """The recordings that are fitted, and those that are driven."""

    search: Search
    driven: tuple[Prepared, ...]


@dataclass(frozen=True)
class _Recipe:
    """What is fitted, and which of it goes into the simulator: mechanisms, and parameters by name."""

    fitted: tuple[CandidateTerm, ...]
    kept: tuple[CandidateTerm, ...]
    free: frozenset[str]
    what: Chosen = Chosen.FINDINGS

    def corrected(self, simulator: Simulator, search: Search, shares: Shares | None) -> CorrectedTruck:
        model = search.model(self.fitted, self.free)
        change = _change(search.e, model, self.free)
        return _truck(simulator, search.e, _terms(self.kept, model), change, shares)


def correct(simulator: Simulator, e: Evidence, x: Explanation, prepared: Sequence[Prepared]) -> Corrections:
    """Corrected simulators, without and with what has no name.

    What is time-varying is of no use on another drive but for its mean, and a parameter that nobody states as
    wrong may only be biased. So what goes in is what free runs ask for along `prepared`, the recordings
    that are not held out, each by a fit to others of them.
    """
    e = left_beside(e.to_fit(), x.model).everywhere()
    search = _as_given(e, ~e.held_out)
    shares = Shares.untold(e)
    alone = _Recipe((), (), frozenset(search.parameters), Chosen.PARAMETERS)
    nothing = _Recipe((), (), frozenset(), Chosen.NOTHING)
    recipes = [nothing, *_recipes(e, x), alone] if x.causes else [nothing]
    folds = _folds(e, prepared) if x.causes else []
    unnamed = _with_laws(x)
    # few recordings drive what was fitted to them, and there more freedom always looks better
    if unnamed is not None and (len(folds) == FOLDS or any(c.other_form for c in x.causes)):
        recipes.append(unnamed)
    driven = [_crossed(simulator, recipe, folds, shares) for recipe in recipes] if folds else []
    own = any(c.other_form or c.effect == UNKNOWN for c in x.causes)  # laws are what was found
    best = _best(recipes, [_mean_square(errors) for errors in driven], own) if driven else 0
    seen = len(folds) < FOLDS or best == 0
    return Corrections(
        alone.corrected(simulator, search, shares),
        recipes[best].corrected(simulator, search, shares),
        unnamed.corrected(simulator, search, shares) if unnamed is not None else None,
        {}
        if seen
        else dict(zip(COMPARED, (driven[k] for k in (0, recipes.index(alone), best)), strict=True)),
        recipes[best].what,
    )


def _best(recipes: Sequence[_Recipe], squares: Sequence[float], own: bool) -> int:
    """Which drives best. Laws join names only where these drive better than parameters without them: laws are
    no proof of names. Where they are a finding of their `own` they need none."""
    order = [int(k) for k in np.argsort(squares)]
    plain = next(k for k in order if recipes[k].what is not Chosen.LAWS)
    return order[0] if own or recipes[plain].what is Chosen.FINDINGS else plain


def _as_given(e: Evidence, only: Mask) -> Search:
    """A search in which parameters that are not corrected stay as given: the others fit beside them so."""
    return Search(e, only=only, held=PINNED)


def _folds(e: Evidence, prepared: Sequence[Prepared]) -> list[_Fold]:
    """Parts of the recordings that are not held out, each to be driven by a fit to the others; all by a fit
    to all, where they are few."""
    fitted = np.flatnonzero([not s.held_out for s in e.stretches])
    parts = [fitted[k::FOLDS] for k in range(FOLDS)] if len(fitted) >= 2 * FOLDS else []
    out = []
    for away in parts or [np.array([], dtype=int)]:
        search = _as_given(e, ~e.held_out & ~np.isin(e.record, away))
        drives = [p for k, p in zip(fitted, prepared, strict=True) if not parts or k in away]
        out.append(_Fold(search, tuple(drives)))
    return out


def _crossed(simulator: Simulator, recipe: _Recipe, folds: Sequence[_Fold], shares: Shares | None) -> Errors:
    """Errors of a recipe in free runs along recordings it was not fitted to."""
    horizon_s = horizon([p for f in folds for p in f.driven])
    each = [(recipe.corrected(simulator, f.search, shares), f.driven) for f in folds]
    return joined([free_windows(truck, drives, horizon_s) for truck, drives in each])


def _with_laws(x: Explanation) -> _Recipe | None:
    """All names and all laws beside them, with every parameter as it was moved."""
    if x.lawful is None:
        return None
    return _Recipe(x.lawful.named, _physics(x.lawful.named), x.lawful.free, Chosen.LAWS)


def _physics(terms: Iterable[CandidateTerm]) -> tuple[CandidateTerm, ...]:
    return tuple(s for s in terms if s.mechanism.kind == "missing_physics")


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


def _recipes(e: Evidence, x: Explanation) -> list[_Recipe]:
    """What is time-varying with its mean, held steady or left out, each with all moved parameters, with the
    stated ones alone and with none."""
    stated = [c.term for c in x.causes if c.term is not None]
    told = [s for s in _physics(x.model.named) if any(s is t for t in stated)]
    lasting = [s for s in told if not is_time_varying(s)]
    parameters = frozenset(c.effect for c in x.causes if c.kind == "parameter_error")
    out = []
    for free in sorted({x.model.free, parameters & x.model.free, frozenset()}, key=lambda f: -len(f)):
        out.append(_Recipe(x.model.named, tuple(told), free))
        if len(lasting) < len(told):
            held = tuple(held_steady(s, e) for s in x.model.named)
            keep = tuple(h for h, s in zip(held, x.model.named, strict=True) if any(s is t for t in told))
            out += [_Recipe(x.model.named, tuple(lasting), free), _Recipe(held, keep, free)]
    return out


def _terms(terms: Sequence[CandidateTerm], model: Model) -> list[Term]:
    return [
        Term(s.mechanism.effect, s.variant, tuple(model.coefficients(s.mechanism.effect).tolist()))
        for s in terms
    ]


def _change(e: Evidence, model: Model, free: Iterable[str]) -> dict[str, float]:
    return {p: float(np.clip(e.total_change(p, model.moved(p)), *e.vehicle.possible(p))) for p in free}


def _mean_square(errors: Errors) -> float:
    return float(np.mean(errors.speed**2)) if len(errors.speed) else 0.0


def horizon(prepared: Sequence[Prepared], most_s: float = HORIZON_S) -> float:
    """Length of the free runs along these recordings, s: shorter where one of them is short."""
    shortest = min((len(p.recording) * p.dt for p in prepared), default=np.inf)
    return min(most_s, max(10.0, shortest - 10.0))


def shown(
    simulator: Simulator, made: Corrections, held_out: Sequence[Prepared], with_unnamed: bool
) -> tuple[dict[str, Errors], CorrectedTruck, FitResult]:
    """Errors of free runs on the held-out recordings, the corrected simulator marked as validated or not, and
    what it is worth. `with_unnamed` corrects by the laws without a name too, where there are any.
    """
    after, chosen = made.after(with_unnamed)
    named, horizon_s = _side_by_side(simulator, made, after), horizon(held_out)
    errors = {name: free_windows(s, held_out, horizon_s) for name, s in named.items()}
    told = compared(errors)
    judged = _judged(errors, made.crossed if after is made.named else {})
    gained = improvement(judged) if told is not None else None
    fit = FitResult(
        held_out=tuple(p.recording.name for p in held_out),
        horizon_s=horizon_s,
        windows=len(errors["before"].speed),
        chosen=chosen,
        corrected=tuple(sorted({t.effect for t in after.terms} | set(after.moved))),
        validated=bool(after.terms or after.moved) and _better(told, gained),
        errors=told,
        improvement=gained,
        refitted={p: round(change, 4) for p, change in after.moved.items()},
    )
    return errors, after.marked(fit.validated), fit


def _side_by_side(simulator: Simulator, made: Corrections, after: CorrectedTruck) -> dict[str, Simulator]:
    """The simulators that are driven beside each other, by the names of `fit`."""
    named: dict[str, Simulator] = {"before": simulator, "parameters_only": made.tuned, "after": after}
    return named | ({"free_model": made.unnamed} if made.unnamed is not None else {})


def _judged(errors: dict[str, Errors], others: dict[str, Errors]) -> dict[str, Errors]:
    """Errors of the free runs whose improvement has an interval: of what was held out, and of the other
    recordings, each driven by a fit that had not seen it, where there are such."""
    if not others or others["before"].speed.shape[1] != errors["before"].speed.shape[1]:
        return errors
    return {name: joined([errors[name], others[name]]) for name in COMPARED}


def _better(errors: Compared | None, gained: Improvement | None) -> bool:
    """Surely so over all that was driven unseen, and no worse over what was held out."""
    if errors is None or gained is None:
        return False
    return gained.ci95[0] > 0.0 and errors.after.speed <= errors.before.speed


@dataclass(frozen=True)
class Driven:
    """An explanation, the simulator corrected by it, and its free runs. `refuted` is what was found and
    withdrawn, as held-out drives speak against it."""

    explanation: Explanation
    errors: dict[str, Errors]
    corrected: CorrectedTruck
    fit: FitResult
    refuted: tuple[Cause, ...] = ()


def corrected_and_driven(
    simulator: Simulator,
    e: Evidence,
    x: Explanation,
    fitted: Sequence[Prepared],
    held_out: Sequence[Prepared],
    with_unnamed: bool,
) -> Driven:
    """The correction, driven; and the explanation, without causes where nothing speaks for these but a little
    evidence."""
    x = _with_blocks(e, x)
    driven = _driven(simulator, e, x, fitted, held_out, with_unnamed)
    if claimed(x, driven.fit, e.rules):
        return driven
    silent = replace(x, causes=(), lawful=None)
    return replace(_driven(simulator, e, silent, fitted, held_out, with_unnamed), refuted=x.causes)


def _with_blocks(e: Evidence, x: Explanation) -> Explanation:
    """With what blocks left out of the fitted drives show of causes that act at a time of their own."""
    of_their_time = [t for t in x.model.named if of_its_time(t)]
    if not of_their_time:
        return x
    fitted = left_beside(e.to_fit(), x.model)
    told = {id(t): left_out(fitted, x.model, t) for t in of_their_time}
    return replace(x, causes=tuple(replace(c, left_out=told.get(id(c.term))) for c in x.causes))


def _driven(
    simulator: Simulator,
    e: Evidence,
    x: Explanation,
    fitted: Sequence[Prepared],
    held_out: Sequence[Prepared],
    with_unnamed: bool,
) -> Driven:
    made = correct(simulator, e, x, fitted)
    return Driven(x, *shown(simulator, made, held_out, with_unnamed))


__all__ = ["HORIZON_S", "Driven", "correct", "corrected", "corrected_and_driven", "horizon", "shown"]
