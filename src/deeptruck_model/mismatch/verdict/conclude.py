"""Assembles the verdict: findings, where they act, and the decision of `decide`."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from deeptruck_model.mismatch.comparison import Compared
from deeptruck_model.mismatch.correction.model import Made
from deeptruck_model.mismatch.correction.validate import Validated
from deeptruck_model.mismatch.folders import AS_GIVEN
from deeptruck_model.mismatch.mechanisms import LIBRARY
from deeptruck_model.mismatch.mechanisms.own import not_compared
from deeptruck_model.mismatch.posterior.regression import FREE
from deeptruck_model.mismatch.prepare import PreparedDrives
from deeptruck_model.mismatch.report import wording
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.residual.noise import Z95
from deeptruck_model.mismatch.result import Advice, Answer, Data, Verdict
from deeptruck_model.mismatch.roads.road import Road, road
from deeptruck_model.mismatch.strength import Strength, strength
from deeptruck_model.mismatch.tree import ROOT, Node
from deeptruck_model.mismatch.unrecorded import contradicted_mass
from deeptruck_model.mismatch.verdict import decide, where
from deeptruck_model.mismatch.verdict.findings import findings, of_fault
from deeptruck_model.mismatch.verdict.witnesses import witnesses


def useless(drives: PreparedDrives) -> Verdict:
    """The verdict if nothing can be compared: a sensor fault if there is one, else undetermined with the
    reason."""
    found = tuple(of_fault(f) for f in drives.faults)
    why = drives.useless or ""
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


def conclude(c: Compared, made: Made, driven: Validated) -> Verdict:
    """The verdict from all results of the comparison."""
    e, fit, rules = c.fitted, driven.judged, c.search.rules
    slope = road(c.search.e.everywhere())
    numbers = _numbers(c, driven)
    found = findings(c, made, slope, numbers.error, decide.tolerance(numbers.own, rules))
    sure = [f.stated != ROOT for f in found]
    numbers = replace(numbers, kinds=[f.kind for f in found], sure=sure)
    kind = decide.conclusion(numbers, rules)
    offered = decide.offered(numbers, kind, rules)
    forces = {i: f.force for i, f in enumerate(found) if f.force is not None}
    error = np.sum(list(forces.values()), axis=0) if forces else e.residual
    return Verdict(
        kind,
        found,
        c.names.explanations,
        c.events,
        tuple(where.segments(e, forces)),
        tuple(where.regimes(e, error)),
        replace(
            fit,
            offered=offered,
            validated=offered != AS_GIVEN,
            corrected_forces=_forces(e, made),
        ),
        Data(c.drives.rejected, c.drives.samples, float(e.everywhere().valid.mean()), c.drives.doubts),
        (
            *c.drives.caveats,
            *_caveats(c),
            *not_compared(e.own, LIBRARY.values(), c.search.library, e),
            *_mass(c, made),
        ),
        c.drives.missing,
        c.budget,
        witnesses(c.search, c.drives.prepared, c.budget),
        tree(c, slope),
        decide.advice(numbers, kind, rules),
    )


def tree(c: Compared, slope: Road | None) -> tuple[Node, ...]:
    """The tree of the unrecorded slope if it states a name; else the probabilities of all names, after that
    of none."""
    if slope is not None and slope.tree.stated(c.search.rules.stated) != ROOT:
        return slope.tree.nodes()
    return (Node("nothing", ROOT, round(c.names.nothing, 4)), *c.names.tree.nodes())


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
        missing=[m.input for m in c.drives.missing],
        doubts=c.drives.doubts,
    )


def _forces(e: Evidence, made: Made) -> dict[str, Strength]:
    """The strength of each force that the correction adds, along the fitted drives."""
    sizes = {t.effect: np.array(t.coefficients) for t in made.corrected.terms}
    return {
        name: strength(e, np.nan_to_num(t.columns) @ sizes[name])
        for t in made.recipe.terms
        if (name := t.mechanism.effect) in sizes
    }


def _caveats(c: Compared) -> list[str]:
    out = []
    if c.search.e.itself is None and not c.search.e.known_physics:
        out.append(wording.COUNTS_AS_LEARNED)
    if not c.search.e.mass_known:
        out.append(wording.WITHOUT_MASS)
    return out


def _mass(c: Compared, made: Made) -> Iterator[str]:
    """Remark on a stated mass that the drives contradict when all parameters are fitted with the
    terms of the correction."""
    model = c.search.model(made.recipe.terms, frozenset(c.search.parameters))
    if "mass" not in c.parameters or "mass" not in model.free or model.moved_sd("mass") >= 0.5 * FREE["mass"]:
        return
    about = c.parameters["mass"] * (1.0 + c.search.e.moved.get("mass", 0.0))
    value, wide = about * (1.0 + model.moved("mass")), Z95 * about * model.moved_sd("mass")
    recordings = [p.recording for p in c.drives.part(held_out=False)]
    yield from contradicted_mass(recordings, value, (value - wide, value + wide))
