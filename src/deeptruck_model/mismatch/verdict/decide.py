"""Decides verdict and advice from numbers alone, of which nothing is measured again."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from deeptruck_model.mismatch.correction.from_draws import Correction
from deeptruck_model.mismatch.correction.validate import Validated
from deeptruck_model.mismatch.folders import AS_GIVEN, CORRECTION, REFIT
from deeptruck_model.mismatch.mechanisms import LIBRARY
from deeptruck_model.mismatch.mechanisms.families import ROOT, UNKNOWN
from deeptruck_model.mismatch.posterior.events import Event
from deeptruck_model.mismatch.posterior.names import Compared, Named, Node
from deeptruck_model.mismatch.prepare.drives import PreparedDrives
from deeptruck_model.mismatch.rules import Rules
from deeptruck_model.mismatch.verdict import wording
from deeptruck_model.mismatch.verdict.findings import of_fault
from deeptruck_model.mismatch.verdict.result import (
    Advice,
    Answer,
    Conclusion,
    Data,
    Finding,
    Kind,
    Regime,
    Segment,
    Verdict,
    Witness,
)


@dataclass(frozen=True)
class Numbers:
    """The numbers that decide a verdict.

    `kinds` of the findings, largest first, and which are `sure`: a node of theirs is stated. Speed errors
    (m/s) in free runs of `horizon_s` along held-out drives, of the simulator as `given`, with refitted
    `parameters_only`, and `corrected` (NaN if no drive is long enough). The error to which the residual along
    fitted drives has `added_up`, without events, over the budget's own horizon (NaN if too few windows are
    free of gaps). The `reference_error` of a learned simulator on its held-out recordings (None if it is not
    learned or not known). Which simulators are significantly `better` than the one as given; the error of the
    corrected one without signals beyond the protocol (`bare`, None if it needs none); whether anything
    `is_corrected`; whether a name is stated or corrected (`named`); which inputs are `missing`, and `doubts`
    about those that are there.
    """

    kinds: Sequence[Kind] = ()
    sure: Sequence[bool] = ()
    given: float = float("nan")
    parameters_only: float = float("nan")
    corrected: float = float("nan")
    horizon_s: float = 40.0
    added_up: float = float("nan")
    reference_error: float | None = None
    better: frozenset[str] = frozenset()
    bare: float | None = None
    is_corrected: bool = False
    named: bool = False
    missing: Sequence[str] = ()
    doubts: Sequence[str] = ()

    @property
    def error(self) -> float:
        """The larger of the errors along held-out and fitted drives, m/s; NaN if neither is known."""
        known = [x for x in (self.given, self.added_up) if np.isfinite(x)]
        return max(known, default=float("nan"))


def tolerance(reference_error: float | None, rules: Rules) -> float:
    """The speed error (m/s) up to which a simulator is good enough; for a learned one, slightly above its
    error on its own recordings."""
    if reference_error is None:
        return rules.visible
    return max(rules.visible, min(rules.differs * reference_error, rules.largest))


def conclusion(n: Numbers, rules: Rules) -> Conclusion:
    """The kind of the finding that explains most. Without a finding, or with none that is stated, nothing
    that matters is missing, unless the simulator's error exceeds the tolerance or is not known."""
    if n.kinds and not (_good_enough(n, rules) and not any(n.sure)):
        return Conclusion(n.kinds[0])
    if _good_enough(n, rules):
        return Conclusion.NOTHING
    return Conclusion.UNDETERMINED


def _sensor_is_wrong(n: Numbers) -> bool:
    """Whether a sensor is stated to be wrong, and not only most probably so."""
    return any(kind is Kind.SENSOR and sure for kind, sure in zip(n.kinds, n.sure, strict=True))


def _good_enough(n: Numbers, rules: Rules) -> bool:
    return bool(np.isfinite(n.error) and n.error <= tolerance(n.reference_error, rules))


def offered(n: Numbers, kind: Conclusion, rules: Rules) -> str:
    """Of the simulators that are significantly better than the one as given the one with the least error
    along held-out drives: all parameters refitted alone only where no name is stated, so that what is offered
    is what is stated. The correction only if it is, without signals that others lack, no worse
    than the one as given.
    If nothing is missing, it must reduce the error by as much as a drift must make to be a finding."""
    errors = {CORRECTION: n.corrected} | ({} if n.named else {REFIT: n.parameters_only})
    better = {name: x for name, x in errors.items() if name in n.better}
    if _worse_bare(n, rules):
        better.pop(CORRECTION, None)
    best = min(better, key=lambda name: better[name], default=AS_GIVEN)
    if kind is Conclusion.NOTHING and not n.given - errors.get(best, n.given) > rules.drift:
        return AS_GIVEN
    return best


def _worse_bare(n: Numbers, rules: Rules) -> bool:
    """Whether the correction without signals beyond the protocol is worse than the simulator as given."""
    return n.bare is not None and rules.better * n.bare > n.given


def advice(n: Numbers, kind: Conclusion, rules: Rules) -> Mapping[str, Advice]:
    """Answers with reasons: whether the data suffice, whether the simulator is good enough, and whether to
    apply the offered simulator."""
    return {"data": _data(n), "simulator": _simulator(n, kind, rules), "apply": _apply(n, kind, rules)}


def _data(n: Numbers) -> Advice:
    if not np.isfinite(n.added_up):
        return Advice(Answer.NO, wording.TOO_SHORT)
    if n.doubts:
        return Advice(Answer.UNSURE, wording.doubtful(n.doubts))
    if Kind.SENSOR in n.kinds:
        return Advice(Answer.UNSURE, wording.FAULTY if _sensor_is_wrong(n) else wording.MAYBE_FAULTY)
    if n.missing:
        return Advice(Answer.UNSURE, wording.not_recorded(n.missing))
    return Advice(Answer.YES, wording.ENOUGH)


def _simulator(n: Numbers, kind: Conclusion, rules: Rules) -> Advice:
    if not np.isfinite(n.given):
        return Advice(Answer.UNSURE, wording.NOT_DRIVEN)
    least = tolerance(n.reference_error, rules)
    if n.error > least:
        return Advice(Answer.NO, wording.too_far(n.given, n.added_up, n.horizon_s, least, n.reference_error))
    if kind is Conclusion.NOTHING and not n.kinds:
        return Advice(Answer.YES, wording.good(n.given, n.horizon_s))
    if kind is Conclusion.SENSOR:
        return Advice(Answer.YES, wording.without_faults(n.given, n.horizon_s))
    return Advice(Answer.YES, wording.good_enough(n.given, n.horizon_s))


def _apply(n: Numbers, kind: Conclusion, rules: Rules) -> Advice:
    if not np.isfinite(n.given):
        return Advice(Answer.NO, wording.NOT_DRIVEN)
    offer = offered(n, kind, rules)
    if offer != AS_GIVEN:
        refit = offer == REFIT
        better = wording.better(n.given, n.parameters_only if refit else n.corrected, refit=refit)
        if n.doubts:
            return Advice(Answer.UNSURE, wording.after_settling(better))
        if Kind.SENSOR in n.kinds:
            return Advice(Answer.UNSURE, wording.after_repair(better, sure=_sensor_is_wrong(n)))
        return Advice(Answer.YES, better)
    if not n.is_corrected:
        return Advice(Answer.NO, wording.NOTHING_CORRECTED)
    if kind is Conclusion.NOTHING:
        return Advice(Answer.NO, wording.AS_IT_IS)
    if CORRECTION in n.better and n.bare is not None and _worse_bare(n, rules):
        return Advice(Answer.UNSURE, wording.worse_bare(n.given, n.corrected, n.bare))
    if min(n.parameters_only, n.corrected) < n.given:
        return Advice(Answer.UNSURE, wording.NOT_SIGNIFICANT)
    return Advice(Answer.NO, wording.NOT_BETTER)


@dataclass(frozen=True)
class Stated:
    """What a verdict states: findings, largest first, the `segments` and `regimes` of driving in which they
    act, events, the probabilities of all names, and channels that predict what has none."""

    findings: tuple[Finding, ...]
    segments: tuple[Segment, ...]
    regimes: tuple[Regime, ...]
    events: tuple[Event, ...]
    tree: tuple[Node, ...]
    witnesses: tuple[Witness, ...]


def unusable(drives: PreparedDrives) -> Verdict:
    """The verdict if nothing can be compared: a sensor fault if there is one, else undetermined with the
    reason."""
    found = tuple(of_fault(f) for f in drives.faults)
    why = drives.unusable_because or ""
    return Verdict(
        Conclusion.SENSOR if found else Conclusion.UNDETERMINED,
        found,
        data=Data(drives.rejected, drives.samples, doubts=drives.doubts),
        caveats=(*drives.caveats, why),
        not_recorded=drives.missing,
        advice={
            "data": Advice(Answer.NO, why),
            "simulator": Advice(Answer.UNSURE, "nothing could be compared"),
            "apply": Advice(Answer.NO, wording.NOTHING_CORRECTED),
        },
    )


def conclude(c: Compared, correction: Correction, driven: Validated, stated: Stated) -> Verdict:
    """The verdict from all results of the comparison, of which nothing is measured again."""
    rules, found = c.regression.rules, stated.findings
    sure = [f.stated != ROOT for f in found]
    numbers = _numbers(c, driven)
    named = numbers.named or any(f.stated == f.effect in LIBRARY for f in found)
    numbers = replace(numbers, kinds=[f.kind for f in found], sure=sure, named=named)
    kind = conclusion(numbers, rules)
    best = offered(numbers, kind, rules)
    return Verdict(
        kind,
        found,
        c.names.explanations,
        stated.events,
        stated.segments,
        stated.regimes,
        replace(
            driven.judged,
            offered=best,
            validated=best != AS_GIVEN,
            tolerance=tolerance(numbers.reference_error, rules),
        ),
        Data(c.drives.rejected, c.drives.samples, c.share_compared, c.drives.doubts),
        (*c.drives.caveats, *c.caveats, *correction.caveats),
        c.drives.missing,
        c.budget,
        stated.witnesses,
        stated.tree,
        advice(numbers, kind, rules),
    )


def name_tree(c: Compared, slope: Named | None) -> tuple[Node, ...]:
    """The tree of the unrecorded slope if it states a name; else the probabilities of all names, after that
    of none."""
    if slope is not None and slope.tree.stated(c.regression.rules.stated) != ROOT:
        return slope.tree.nodes()
    return (Node("nothing", ROOT, round(c.names.nothing, 4)), *c.names.tree.nodes())


def tolerated(c: Compared, driven: Validated) -> tuple[float, float]:
    """The simulator's speed error, with refitted parameters where these are significantly better, and that up
    to which it is good enough, m/s."""
    n = _numbers(c, driven)
    error = n.parameters_only if REFIT in n.better else n.error
    return error, tolerance(n.reference_error, c.regression.rules)


def _numbers(c: Compared, driven: Validated) -> Numbers:
    fit, nan = driven.judged, float("nan")
    errors = fit.errors
    return Numbers(
        given=errors.before.speed if errors is not None else nan,
        parameters_only=errors.parameters_only.speed if errors is not None else nan,
        corrected=errors.after.speed if errors is not None else nan,
        horizon_s=fit.horizon_s,
        added_up=c.budget.speed_rmse,
        reference_error=driven.reference_error,
        better=driven.better,
        bare=fit.without_exogenous.after if fit.without_exogenous is not None else None,
        is_corrected=bool(fit.corrected),
        named=any(name != UNKNOWN for name in fit.corrected),
        missing=[m.input for m in c.drives.missing],
        doubts=c.drives.doubts,
    )
