"""From an explanation to a corrected simulator: which terms and parameters go in, and what that improves.

Everything is fitted, and chosen, without the held-out recordings.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial

from deeptruck_model.mismatch.correction.claims import OwnCorrection, claimed
from deeptruck_model.mismatch.correction.corrected_truck import CorrectedTruck
from deeptruck_model.mismatch.correction.improvement import (
    compared,
    free_runs,
    horizon,
    improvement,
    joined,
)
from deeptruck_model.mismatch.correction.recipes import (
    Recipe,
    Trials,
    as_given,
    best_of,
    folds_of,
    holds,
    recipes_of,
    with_laws,
)
from deeptruck_model.mismatch.data.prepared import Prepared
from deeptruck_model.mismatch.fit_result import Chosen, Compared, Errors, FitResult, HandedOver, Improvement
from deeptruck_model.mismatch.posterior.causes import Cause, Explanation
from deeptruck_model.mismatch.posterior.kernels import UNKNOWN
from deeptruck_model.mismatch.posterior.left_out import left_out, of_its_time
from deeptruck_model.mismatch.posterior.nuisances import left_beside
from deeptruck_model.mismatch.residual.components import Shares
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.simulators import Simulator

COMPARED = ("before", "parameters_only", "after")


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
    for_driving: bool = False  # whether `named` has the sizes that drive best
    whole: CorrectedTruck | None = None  # with all that was found, whatever drives best
    whole_crossed: tuple[Errors, Errors] | None = None  # of the simulator as given and of it, as `crossed`

    def after(self, with_unnamed: bool) -> tuple[CorrectedTruck, Chosen]:
        """The corrected simulator, with laws for what has no name where these are asked for and there."""
        if with_unnamed and self.unnamed is not None and self.chosen is not Chosen.LAWS:
            return self.unnamed, Chosen.LAWS
        return self.named, self.chosen


def correct(
    simulator: Simulator,
    e: Evidence,
    x: Explanation,
    prepared: Sequence[Prepared],
    horizon_s: float,
) -> Corrections:
    """Corrected simulators, without and with what has no name, chosen in free runs of `horizon_s`.

    What is time-varying is of no use on another drive but for its mean, and a parameter that nobody states as
    wrong may only be biased. So what goes in is what free runs ask for along `prepared`, the recordings
    that are not held out, each by a fit to others of them.
    """
    e = left_beside(e.to_fit(), x.model).everywhere()
    search = as_given(e, ~e.held_out)
    trials = Trials(
        simulator,
        folds_of(e, prepared) if x.causes else [],
        Shares.untold(e),
        e.rules,
        horizon_s,
    )
    alone = Recipe((), (), frozenset(search.parameters), Chosen.PARAMETERS)
    nothing = Recipe((), (), frozenset(), Chosen.NOTHING)
    recipes = [nothing, *recipes_of(e, x), alone] if x.causes else [nothing]
    unnamed = with_laws(x)
    # few recordings drive what was fitted to them, and there more freedom always looks better
    if unnamed is not None and (trials.crossed or any(c.other_form for c in x.causes)):
        recipes.append(unnamed)
    own = any(
        c.other_form or c.predictable or c.effect == UNKNOWN for c in x.causes
    )  # laws are what was found
    squares = trials.squares(recipes)
    first = best_of(recipes, squares, own)
    complete = {
        k: square for k, square in enumerate(squares) if recipes[k] is not alone and holds(recipes[k], x)
    }
    whole = recipes[min(complete, key=complete.__getitem__)] if complete else nothing
    tuned, best, whole = trials.with_better_sizes([alone, first, whole])
    driven = trials.errors([nothing, tuned, best, whole]) if trials.crossed else []
    truck = partial(Recipe.corrected, simulator=simulator, search=search, shares=trials.shares)
    return Corrections(
        truck(tuned),
        truck(best),
        truck(best if best.what is Chosen.LAWS else unnamed) if unnamed is not None else None,
        dict(zip(COMPARED, driven, strict=False)) if driven and best is not nothing else {},
        best.what,
        best.for_driving,
        truck(whole),
        (driven[0], driven[-1]) if driven else None,
    )


def shown(
    simulator: Simulator, made: Corrections, held_out: Sequence[Prepared], with_unnamed: bool
) -> tuple[dict[str, Errors], CorrectedTruck, FitResult]:
    """Errors of free runs on the held-out recordings, the corrected simulator marked as validated or not, and
    what it is worth. `with_unnamed` corrects by the laws without a name too, where there are any.
    """
    after, chosen = made.after(with_unnamed)
    named, horizon_s = _side_by_side(simulator, made, after), horizon(held_out)
    driven = free_runs([(truck, held_out) for truck in named.values()], horizon_s)
    errors = dict(zip(named, driven, strict=True))
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
        for_driving=made.for_driving and after is made.named,
        handed_over=_handed_over(after, held_out, horizon_s),
        scales_forces=not simulator.parameters(),
    )
    fit = replace(fit, validated=fit.validated and not fit.harms_alone)
    return errors, after.marked(fit.validated), fit


def _handed_over(after: CorrectedTruck, held_out: Sequence[Prepared], horizon_s: float) -> HandedOver | None:
    """As whoever drives the corrected simulator has it, told what the protocol tells alone."""
    lacks = after.asks_beyond()
    if not lacks:
        return None
    errors = free_runs([(after, held_out)], horizon_s, alone=True)[0]
    return HandedOver(lacks, errors.rmse().speed) if len(errors.speed) else None


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
    """Surely so over all that was driven unseen, and over what was held out too, where a correction that
    changes nothing shows nothing."""
    if errors is None or gained is None:
        return False
    return gained.ci95[0] > 0.0 and errors.after.speed < errors.before.speed


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
    horizon_s = horizon(held_out or fitted)  # one for both, so that their free runs can be told together
    made = correct(simulator, e, x, fitted, horizon_s)
    if claimed(x, lambda: own_correction(simulator, x, made, held_out), e.rules):
        errors, corrected, fit = shown(simulator, made, held_out, with_unnamed)
        return Driven(x, errors, corrected, replace(fit, by_mean=_by_mean(x, corrected)))
    silent = replace(x, causes=(), lawful=None)
    made = correct(simulator, e, silent, fitted, horizon_s)
    return Driven(silent, *shown(simulator, made, held_out, with_unnamed), refuted=x.causes)


def _by_mean(x: Explanation, corrected: CorrectedTruck) -> tuple[str, ...]:
    """Effects in it of which another drive can have the mean alone: sizes of theirs are those of a time, a
    place or a recording."""
    passing = {t.mechanism.effect for t in x.model.named if not (t.variant.is_a_law or t.variant.comes_again)}
    return tuple(sorted(passing & {t.effect for t in corrected.terms}))


def own_correction(
    simulator: Simulator, x: Explanation, made: Corrections, held_out: Sequence[Prepared]
) -> OwnCorrection:
    """All that was found, driven, whatever drives best."""
    horizon_s = horizon(held_out)
    both = [simulator, *([made.whole] if made.whole is not None else [])]
    before, *others = free_runs([(truck, held_out) for truck in both], horizon_s)
    after = others[0] if others else before
    within = {c.acts_as for c in x.causes} <= set(made.named.moved)
    chosen = made.chosen in (Chosen.FINDINGS, Chosen.LAWS) or within
    return OwnCorrection(before, after, made.whole_crossed, chosen)


def _with_blocks(e: Evidence, x: Explanation) -> Explanation:
    """With what blocks left out of the fitted drives show of causes that act at a time of their own."""
    of_their_time = [t for t in x.model.named if of_its_time(t)]
    if not of_their_time:
        return x
    fitted = left_beside(e.to_fit(), x.model)
    told = {id(t): left_out(fitted, x.model, t) for t in of_their_time}
    return replace(x, causes=tuple(replace(c, left_out=told.get(id(c.term))) for c in x.causes))
