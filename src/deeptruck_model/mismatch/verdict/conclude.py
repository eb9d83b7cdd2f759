"""Assembles the verdict from what the stages have found, and from the decision of `decide`."""

from __future__ import annotations

from dataclasses import dataclass, replace

from deeptruck_model.mismatch.correction.model import Correction
from deeptruck_model.mismatch.correction.validate import Validated
from deeptruck_model.mismatch.folders import AS_GIVEN
from deeptruck_model.mismatch.mechanisms.families import ROOT
from deeptruck_model.mismatch.posterior.comparison import Compared
from deeptruck_model.mismatch.posterior.names import Node
from deeptruck_model.mismatch.prepare.drives import PreparedDrives
from deeptruck_model.mismatch.verdict import decide, wording
from deeptruck_model.mismatch.verdict.findings import of_fault
from deeptruck_model.mismatch.verdict.result import Advice, Answer, Data, Finding, Regime, Segment, Verdict
from deeptruck_model.mismatch.verdict.road import Road
from deeptruck_model.mismatch.verdict.witnesses import Witness


@dataclass(frozen=True)
class Stated:
    """What a verdict states: findings, largest first, the `segments` and `regimes` of driving in which they
    act, the probabilities of all names, and channels that predict what has none."""

    findings: tuple[Finding, ...]
    segments: tuple[Segment, ...]
    regimes: tuple[Regime, ...]
    tree: tuple[Node, ...]
    witnesses: tuple[Witness, ...]


def unusable(drives: PreparedDrives) -> Verdict:
    """The verdict if nothing can be compared: a sensor fault if there is one, else undetermined with the
    reason."""
    found = tuple(of_fault(f) for f in drives.faults)
    why = drives.unusable_because or ""
    return Verdict(
        decide.uncompared(faulty=bool(found)),
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
    rules, found = c.search.rules, stated.findings
    sure = [f.stated != ROOT for f in found]
    numbers = replace(_numbers(c, driven), kinds=[f.kind for f in found], sure=sure)
    kind = decide.conclusion(numbers, rules)
    offered = decide.offered(numbers, kind, rules)
    return Verdict(
        kind,
        found,
        c.names.explanations,
        c.events,
        stated.segments,
        stated.regimes,
        replace(driven.judged, offered=offered, validated=offered != AS_GIVEN),
        Data(c.drives.rejected, c.drives.samples, c.share_compared, c.drives.doubts),
        (*c.drives.caveats, *c.caveats, *correction.caveats),
        c.drives.missing,
        c.budget,
        stated.witnesses,
        stated.tree,
        decide.advice(numbers, kind, rules),
    )


def name_tree(c: Compared, slope: Road | None) -> tuple[Node, ...]:
    """The tree of the unrecorded slope if it states a name; else the probabilities of all names, after that
    of none."""
    if slope is not None and slope.tree.stated(c.search.rules.stated) != ROOT:
        return slope.tree.nodes()
    return (Node("nothing", ROOT, round(c.names.nothing, 4)), *c.names.tree.nodes())


def tolerated(c: Compared, driven: Validated) -> tuple[float, float]:
    """The simulator's speed error, and that up to which it is good enough, m/s."""
    numbers = _numbers(c, driven)
    return numbers.error, decide.tolerance(numbers.own, c.search.rules)


def _numbers(c: Compared, driven: Validated) -> decide.Numbers:
    fit, nan = driven.judged, float("nan")
    errors = fit.errors
    return decide.Numbers(
        given=errors.before.speed if errors is not None else nan,
        parameters_only=errors.parameters_only.speed if errors is not None else nan,
        corrected=errors.after.speed if errors is not None else nan,
        horizon_s=fit.horizon_s,
        added_up=c.budget.speed_rmse,
        own=driven.own_error,
        better=driven.better,
        beyond_refit=fit.improvement is None or fit.improvement.over_parameters_ci95[0] > 0.0,
        bare=fit.without_exogenous.after if fit.without_exogenous is not None else None,
        is_corrected=bool(fit.corrected),
        fewer=not fit.corrected_forces and len(fit.corrected_parameters) < len(fit.refit),
        missing=[m.input for m in c.drives.missing],
        doubts=c.drives.doubts,
    )
