"""The verdict: the only file that names one. All numbers and the rules go in, a `Verdict` comes out."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from deeptruck_model.mismatch import where
from deeptruck_model.mismatch.budget import Budget
from deeptruck_model.mismatch.classify import Named
from deeptruck_model.mismatch.comparison import Compared
from deeptruck_model.mismatch.data.checks import SensorFault
from deeptruck_model.mismatch.detectable import smallest_visible
from deeptruck_model.mismatch.folders import AS_GIVEN, REFIT
from deeptruck_model.mismatch.mechanisms import LIBRARY
from deeptruck_model.mismatch.model import Made
from deeptruck_model.mismatch.posterior.regression import FREE, Regression
from deeptruck_model.mismatch.prepare import Drives
from deeptruck_model.mismatch.report import wording
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.residual.noise import Z95
from deeptruck_model.mismatch.result import Advice, Answer, Conclusion, Finding, Kind, Size, Verdict
from deeptruck_model.mismatch.road import Road
from deeptruck_model.mismatch.rules import Rules
from deeptruck_model.mismatch.sizes import sizes_of
from deeptruck_model.mismatch.strength import Strength, acts, visible
from deeptruck_model.mismatch.tree import FAMILY, ROOT, UNKNOWN, Node
from deeptruck_model.mismatch.unrecorded import NotRecorded, contradicted_mass
from deeptruck_model.mismatch.validate import Validated
from deeptruck_model.mismatch.witnesses import Witness

Array = NDArray[np.float64]

LATE = ("command_delay", "clock_offset")
FAULT = 0.99  # probability that is reported of a fault, `sensor_sd` off: its deviation is an estimate


def useless(drives: Drives, missing: tuple[NotRecorded, ...]) -> Verdict:
    """Where nothing can be compared: a fault of the sensors if there is one, else undetermined, and why."""
    findings = tuple(of_fault(f) for f in drives.faults)
    why = drives.useless or ""
    return Verdict(
        Conclusion.SENSOR if findings else Conclusion.UNDETERMINED,
        findings,
        rejected=drives.rejected,
        caveats=(*drives.caveats, why),
        not_recorded=missing,
        advice={
            "data": Advice(Answer.NO, why),
            "simulator": Advice(Answer.UNSURE, "nothing could be compared"),
            "apply": Advice(Answer.NO, wording.NOTHING_CORRECTED),
        },
        recorded=drives.samples,
    )


def decide(
    c: Compared,
    road: Road | None,
    witnesses: tuple[Witness, ...],
    made: Made,
    driven: Validated,
    rules: Rules,
) -> Verdict:
    """The verdict from all that was measured."""
    e = c.search.e
    findings = [of_fault(f) for f in c.drives.faults]
    of_road = _of_road(e, road, rules)
    named, matter = accepted(c, made, driven, rules)
    findings += _with_shares(e, of_road + matter)
    detected = c.names.detected and not (named and not matter)
    kind = _kind(findings, detected, c.budget, driven, rules)
    forces = {i: f.force for i, f in enumerate(findings) if f.force is not None}
    error = np.sum(list(forces.values()), axis=0) if forces else e.residual
    offered = AS_GIVEN if kind is Conclusion.NOTHING else driven.fit.offered  # what is right is not corrected
    ahead = road.ahead if road is not None else None
    fit = replace(driven.fit, offered=offered, validated=offered != AS_GIVEN, next_pass=ahead)
    driven = replace(driven, fit=fit)
    first = c.names.found[0].tree if c.names.found else None
    first = road.tree if road is not None and of_road else first
    return Verdict(
        kind,
        tuple(findings),
        tuple(where.segments(e, forces)),
        tuple(where.regimes(e, error)),
        driven.fit,
        c.drives.rejected,
        smallest_visible(c.search, c.names.threshold, rules) if not findings else None,
        (*c.drives.caveats, *_caveats(e), *_mass(c, made)),
        c.missing,
        c.budget,
        witnesses,
        first.nodes() if first is not None else (Node("nothing", ROOT, 1.0),),
        advice(c.missing, kind, c.budget, driven, rules, faults=bool(c.drives.faults)),
        c.drives.samples,
        float(e.everywhere().valid.mean()),
    )


def _of_road(e: Evidence, road: Road | None, rules: Rules) -> list[Finding]:
    """The road, where what is slow depends on its position and its name is stated."""
    if road is None or road.tree.stated(rules.stated) == ROOT:
        return []
    m = LIBRARY[road.tree.first]
    return [
        _finding(
            e,
            road.named(),
            Kind(m.kind),
            m.says,
            m.equation,
            {},
            m.depends_on,
            m.separated_by,
            road.force,
            rules,
        )
    ]


def accepted(
    c: Compared, made: Made | None, driven: Validated | None, rules: Rules
) -> tuple[list[Finding], list[Finding]]:
    """The findings of what was named, and those of them that matter; without sizes where nothing was made."""
    named = _findings(c, made, rules)
    right = _right(c.budget, driven, rules)
    return named, [
        f for f in named if _longer_than_sensors(f, c.search.e) and not (right and f.effect == UNKNOWN)
    ]


def _findings(c: Compared, made: Made | None, rules: Rules) -> list[Finding]:
    """The findings of what was named."""
    search, out = c.search, []
    for named in c.names.found:
        first = named.name
        by_parameters = named.free <= c.names.threshold  # free parameters explain it as well
        if first in search.parameters and (first not in LIBRARY or by_parameters):
            f = _of_parameter(search, named, c.parameters, rules)
        else:
            f = _of_name(search, made, named, rules)
            if by_parameters:
                f = _or_parameters(search, f, rules)
        if f is not None and named.accepted:
            out.append(replace(f, missing_input=c.behind.get(f.effect, "")))
    return out


def _or_parameters(search: Regression, f: Finding, rules: Rules) -> Finding | None:
    """A finding that parameters explain as well, with these in its credible set; None where none of them
    would change by more than that of any simulator may be off."""
    others = tuple(p for p in search.parameters if _change(search, p, rules) is not None and p != f.effect)
    if not others:
        return None
    return replace(f, cannot_be_told_from=tuple(dict.fromkeys((*f.cannot_be_told_from, *others))))


def _change(search: Regression, parameter: str, rules: Rules) -> tuple[float, float] | None:
    """Relative change of a parameter from the simulator as given, and its standard deviation; None where it
    gains too little, or may be that of any simulator."""
    free = search.background(())
    if parameter not in free.free:
        free = search.model((), frozenset(search.parameters))
    gain = free.score - search.model((), free.free - {parameter}).score if parameter in free.free else 0.0
    change, sd = search.e.total_change(parameter, free.moved(parameter)), free.moved_sd(parameter)
    if abs(change) - Z95 * sd < rules.nearly_right or gain < rules.parameter_gain:
        return None
    return change, sd


def _longer_than_sensors(f: Finding, e: Evidence) -> bool:
    """Whether a finding is not only a lateness that ordinary message periods and filters have. Of a lateness
    the sensors' own columns hold a part, so that the whole residual is compared."""
    if f.effect not in LATE or f.force is None:
        return True
    late = e.rerun("delay_all", e.rules.least_delay_s)[e.valid]
    times = abs(float(e.residual[e.valid] @ late)) / max(float(late @ late), 1e-12)
    return times > 1.0


def _with_shares(e: Evidence, findings: Sequence[Finding]) -> list[Finding]:
    """The findings, each with its share of the squares of all their forces."""
    squares = [float(np.sum(f.force[e.valid] ** 2)) if f.force is not None else 0.0 for f in findings]
    total = sum(squares) or 1.0
    return [
        replace(f, share_of_explainable_error=round(x / total, 3))
        for f, x in zip(findings, squares, strict=True)
    ]


def _of_parameter(search: Regression, named: Named, own: Mapping[str, float], rules: Rules) -> Finding | None:
    """An error of a parameter; None where it is no larger than that of any simulator may be."""
    name = named.name
    changed = _change(search, name, rules)
    if changed is None:
        return None
    change, sd = changed
    sizes = {"relative_error": Size(change, "1", (change - Z95 * sd, change + Z95 * sd))}
    if name in own:
        value = own[name]
        sizes = {
            name: Size(
                value * (1 + change),
                wording.PARAMETER_UNITS.get(name, "1"),
                (value * (1 + change - Z95 * sd), value * (1 + change + Z95 * sd)),
            )
        } | sizes
    force = np.nan_to_num(search.e.sensitivity[name]) * change
    return _finding(
        search.e,
        named,
        Kind.PARAMETER,
        wording.of_parameter(name, change),
        "",
        sizes,
        ("all driving",),
        wording.PARAMETER_MANOEUVRE.get(name, ""),
        force,
        rules,
    )


def _of_name(search: Regression, made: Made | None, named: Named, rules: Rules) -> Finding:
    """A force of a mechanism, or one that has no name."""
    first = named.name
    if first == UNKNOWN:
        return _finding(
            search.e,
            named,
            Kind.PHYSICS,
            wording.UNKNOWN_FORCE,
            "",
            {},
            (),
            wording.RECORD_MORE,
            named.force,
            rules,
        )
    m = LIBRARY[first]
    return _finding(
        search.e,
        named,
        Kind(m.kind),
        m.says,
        m.equation,
        _sizes(first, made, search),
        m.depends_on,
        m.separated_by,
        named.force,
        rules,
    )


def _sizes(name: str, made: Made | None, search: Regression) -> dict[str, Size]:
    """Those of the term that was made of a name; none where there is none."""
    if made is None:
        return {}
    term = next((t for t in made.recipe.terms if t.mechanism.effect == name), None)
    return {} if term is None else sizes_of(term, made.fit, search.e)


def _finding(
    e: Evidence,
    named: Named,
    kind: Kind,
    says: str,
    equation: str,
    sizes: dict[str, Size],
    depends_on: tuple[str, ...],
    manoeuvre: str,
    force: Array,
    rules: Rules,
) -> Finding:
    first = named.name
    family = FAMILY[first]
    rivals = tuple(n for n in named.tree.credible(rules.credible) if n != first)
    return Finding(
        kind,
        first,
        family,
        named.tree.stated(rules.stated),
        says,
        equation,
        sizes,
        round(named.tree.names[first], 3),
        round(named.tree.families[family], 3),
        manoeuvre,
        depends_on,
        rivals,
        evidence_nats=round(named.held, 1),
        strength=_strength(e, force),
        force=force,
    )


def _strength(e: Evidence, force: Array) -> Strength:
    """How strong a force (n,), m/s^2, is while it acts."""
    on = acts(force, visible(e), e.dt)
    part = e.newtons(force)[on] / e.mass * e.unit.scale if on.any() else np.zeros(1)
    one_way = bool(abs(part.mean()) > 0.5 * np.abs(part).mean())
    value = float(part.mean() if one_way else np.sqrt(np.mean(part**2)))
    return Strength(value, e.unit.name, one_way, float(on.sum() / max(e.valid.sum(), 1)))


def of_fault(f: SensorFault) -> Finding:
    """A fault that shows between sensors alone."""
    ci = (f.value - Z95 * f.se, f.value + Z95 * f.se)
    return Finding(
        Kind.SENSOR, f.effect, FAMILY[f.effect], f.effect, f.says, f.equation,
        {"value": Size(f.value, f.unit, ci)}, FAULT, FAULT, wording.SENSOR_MANOEUVRE, f.between,
        share_of_explainable_error=0.0,
    )  # fmt: skip


def _kind(
    findings: Sequence[Finding], detected: bool, found: Budget, driven: Validated, rules: Rules
) -> Conclusion:
    """The kind of the finding that explains most; without one, `nothing_missing` only where nothing that
    matters is left."""
    if findings:
        explaining = max(findings, key=lambda f: f.share_of_explainable_error)
        return Conclusion(explaining.kind)
    if detected or not _right(found, driven, rules):
        return Conclusion.UNDETERMINED
    return Conclusion.NOTHING


def _right(found: Budget, driven: Validated | None, rules: Rules) -> bool:
    """Whether nothing that matters is left: the budget's windows of fitted drives and free runs along
    held-out ones are off by little, or hardly more than a learned simulator is on its own recordings."""
    errors = driven.fit.errors if driven is not None else None
    held = errors.before.speed if errors is not None else found.speed_rmse
    error = max(held, found.speed_rmse) if np.isfinite(found.speed_rmse) else held
    if not np.isfinite(error):
        return False
    if driven is not None and driven.own_error is not None:
        return error <= min(rules.differs * driven.own_error, rules.largest)
    return error <= rules.visible


def _caveats(e: Evidence) -> list[str]:
    out = []
    if e.itself is None and not e.known_physics:
        out.append(wording.COUNTS_AS_LEARNED)
    if not e.mass_known:
        out.append(wording.WITHOUT_MASS)
    return out


def _mass(c: Compared, made: Made) -> Iterator[str]:
    """A stated mass that the drives contradict, with all parameters free beside what was found."""
    model = c.search.model(made.recipe.terms, frozenset(c.search.parameters))
    if "mass" not in c.parameters or "mass" not in model.free or model.moved_sd("mass") >= 0.5 * FREE["mass"]:
        return
    about = c.parameters["mass"] * (1.0 + c.search.e.moved.get("mass", 0.0))
    value, wide = about * (1.0 + model.moved("mass")), Z95 * about * model.moved_sd("mass")
    recordings = [p.recording for p in c.drives.part(held_out=False)]
    yield from contradicted_mass(recordings, value, (value - wide, value + wide))


def advice(
    missing: Sequence[NotRecorded],
    kind: Conclusion,
    found: Budget,
    driven: Validated,
    rules: Rules,
    *,
    faults: bool,
) -> dict[str, Advice]:
    """Whether the data are enough, the simulator is good enough, and the correction should be applied."""
    hidden = [m.input for m in missing]
    if not found.parts:
        data = Advice(Answer.NO, wording.TOO_SHORT)
    elif hidden:
        data = Advice(Answer.UNSURE, wording.not_recorded(hidden))
    else:
        data = Advice(Answer.YES, wording.ENOUGH)
    errors = driven.fit.errors
    if errors is None:
        return {
            "data": data,
            "simulator": Advice(Answer.UNSURE, wording.NOT_DRIVEN),
            "apply": Advice(Answer.NO, wording.NOT_DRIVEN),
        }
    if kind is Conclusion.NOTHING:
        simulator = Advice(Answer.YES, wording.good(errors.before.speed, driven.fit.horizon_s))
    elif kind is Conclusion.SENSOR and errors.before.speed <= rules.visible:
        simulator = Advice(Answer.YES, wording.without_faults(errors.before.speed, driven.fit.horizon_s))
    elif errors.before.speed <= rules.visible:
        simulator = Advice(Answer.UNSURE, wording.off(errors.before.speed, driven.fit.horizon_s))
    else:
        simulator = Advice(Answer.NO, wording.off(errors.before.speed, driven.fit.horizon_s))
    if driven.fit.validated:
        refit = driven.fit.offered == REFIT
        after = errors.parameters_only if refit else errors.after
        better = wording.better(errors.before.speed, after.speed, refit=refit)
        apply = Advice(Answer.UNSURE, wording.after_repair(better)) if faults else Advice(Answer.YES, better)
    elif kind is Conclusion.NOTHING or not driven.fit.corrected:
        apply = Advice(Answer.NO, wording.NOTHING_CORRECTED)
    elif min(errors.after.speed, errors.parameters_only.speed) < errors.before.speed:
        apply = Advice(Answer.UNSURE, wording.NOT_SIGNIFICANT)
    else:
        apply = Advice(Answer.NO, wording.NOT_BETTER)
    return {"data": data, "simulator": simulator, "apply": apply}
