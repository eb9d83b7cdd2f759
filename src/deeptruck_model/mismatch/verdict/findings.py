"""Findings: the accepted effects, their sizes, the drives in which they act, and the alternative names."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from scipy.stats import norm

from deeptruck_core.arrays import Array
from deeptruck_core.signals import FELT
from deeptruck_model.mismatch.correction.fit_result import strength, visible
from deeptruck_model.mismatch.correction.from_draws import Correction
from deeptruck_model.mismatch.mechanisms import LIBRARY, CandidateTerm
from deeptruck_model.mismatch.mechanisms.courses import Where
from deeptruck_model.mismatch.mechanisms.families import (
    EACH_DRIVE,
    FAMILY,
    LEFT_OVER,
    PARAMETER_ERRORS,
    PLACE,
    ROOT,
    SLOW,
    UNKNOWN,
)
from deeptruck_model.mismatch.posterior.budget import Budget
from deeptruck_model.mismatch.posterior.names import Compared, Named, Tree
from deeptruck_model.mismatch.prepare.drives import NotRecorded
from deeptruck_model.mismatch.prepare.sensors import SensorFault
from deeptruck_model.mismatch.residual.evidence import Evidence, unit
from deeptruck_model.mismatch.residual.noise import Z95
from deeptruck_model.mismatch.rules import Limits, Rules
from deeptruck_model.mismatch.verdict import wording
from deeptruck_model.mismatch.verdict.result import Alternative, Bound, Finding, Kind, Size
from deeptruck_model.mismatch.verdict.sizes import fitted_sizes, sizes_of
from deeptruck_model.mismatch.verdict.where import PRINTED
from deeptruck_model.recordings import Recording

NORMAL = norm.ppf((np.arange(400) + 0.5) / 400)  # draws of a standard normal
FAULT = 0.99  # probability that is reported of a fault, `sensor_sd` off: its deviation is an estimate


def findings(
    c: Compared, correction: Correction, road: Named | None, error: float, tolerance: float
) -> tuple[Finding, ...]:
    """The findings: sensor faults, the road, every accepted name, differences between drives, and slow or
    position-dependent forces if the simulator's error exceeds `tolerance`, m/s."""
    e, rules = c.fitted, c.regression.rules
    behind = names_behind([p.recording for p in c.drives.prepared], c.drives.missing)
    out = [of_fault(f) for f in c.drives.faults]
    of_road = _of_road(c, road, rules)
    out += of_road
    road_names = {f.effect for f in of_road}  # whole, where the residual of a learned truck has a rest of it
    for named in (named for named in c.names.found if named.name not in correction.needless):
        f = _of_named(c, e, correction, named, rules) if named.name not in road_names else None
        if f is not None and named.accepted:
            each = tuple(_alternatives(c, correction, f, named))
            out.append(replace(f, missing_input=behind.get(f.effect, ""), alternatives=each))
    of_slope = not e.has("grade") and any(f.effect == LIBRARY.of_input("grade").effect for f in out)
    if not of_road and not of_slope:  # which would be what is slow too
        out += _of_drift(c, rules, good_enough=error <= tolerance)
    if error > tolerance and all(f.kind is Kind.SENSOR for f in out):
        out += _of_rest(c, rules)
    shown = _with_shares(e, out, c.budget)
    return tuple(sorted(shown, key=lambda f: (f.stated == ROOT, -f.share_of_explainable_error)))


def _of_named(c: Compared, e: Evidence, correction: Correction, named: Named, rules: Rules) -> Finding | None:
    name = named.name
    if c.posterior.is_parameter(name):
        return _of_parameter(c, named, correction, rules)
    if name == UNKNOWN:
        f = _finding(c, named, Kind.PHYSICS, wording.UNKNOWN_FORCE, named.force)
        return replace(f, separating_manoeuvre=wording.RECORD_MORE)
    m = LIBRARY[name]
    felt = m.of_input == "grade" and e.has(FELT)
    says = wording.FELT_SLOPE if felt else m.says
    term = next((t for t in correction.terms if t.mechanism.effect == name), None)
    exact = correction.fitted
    if exact is not None and exact.places(name):
        force, sizes = exact.force(name), fitted_sizes(exact, name)
        f = _finding(c, named, Kind(m.kind), says, force, exact.relative_sd(name))
    else:
        f = _finding(c, named, Kind(m.kind), says, named.force)
        sizes = sizes_of(term, c.posterior, named.given) if term is not None else {}
    mass = c.parameters.get("mass")
    loads = {x.drive: x.value for x in sizes.values() if x.drive and x.unit == "kg"}
    return replace(
        f,
        in_log=felt,
        in_condition=_condition(term, e) if term is not None else "",
        equation=m.equation,
        parameters=sizes,
        depends_on=m.depends_on,
        separating_manoeuvre=m.manoeuvre,
        mass_by_drive={d: mass + x for d, x in loads.items()} if mass is not None else {},
    )


def _alternatives(c: Compared, correction: Correction, f: Finding, named: Named) -> Iterator[Alternative]:
    """The names of a finding's credible set, with the size that each would need; none if one is stated."""
    p = c.posterior
    for name in f.credible_set if f.stated != f.effect and f.rivals else ():
        probability, given = named.tree.names[name], p.inside(name)
        term = next((t for t in correction.terms if t.mechanism.effect == name), None)
        if p.is_parameter(name):
            yield Alternative(name, probability, Size(p.change(name, given)[0], "1"))
        elif term is None:
            yield Alternative(name, probability)
        else:
            b = p.on_columns(name, term.columns, given).mean(axis=0)
            usual = float(np.max(np.abs(b) / (np.abs(term.prior.mean) + term.prior.sd)))
            own = f.parameters if name == f.effect else sizes_of(term, p, given)
            known = [x for x in own.values() if x.ci95 is not None]
            known.sort(key=lambda x: -abs(x.value) if x.drive else 0.0)  # of drives the one that differs most
            size = known[0] if known else None
            yield Alternative(name, probability, size, usual)


def _condition(term: CandidateTerm, e: Evidence) -> str:
    """The one condition in which a term acts; empty if it acts always."""
    course = term.variants[0].course
    if not isinstance(course, Where):
        return ""
    low, high = (-np.inf, course.above) if course.below else (course.above, np.inf)
    signal = PRINTED.get(course.signal, course.signal)
    return str(Bound(signal, low, high, unit(course.signal, e.command_units)))


def _of_road(c: Compared, road: Named | None, rules: Rules) -> list[Finding]:
    """The finding of the road of a learned simulator, if its name is stated."""
    if road is None or road.tree.stated(rules.stated) == ROOT:
        return []
    m = LIBRARY[road.name]
    f = _finding(c, road, Kind(m.kind), m.says, road.force)
    return [replace(f, equation=m.equation, depends_on=m.depends_on, separating_manoeuvre=m.manoeuvre)]


def _of_drift(c: Compared, rules: Rules, *, good_enough: bool) -> list[Finding]:
    """Findings of forces that follow no recorded channel: slow, position-dependent, or different in each
    drive. If the simulator is `good_enough`, only those that differ between drives are reported."""
    out = []
    for part in (EACH_DRIVE,) if good_enough else (EACH_DRIVE, PLACE, SLOW):
        p, share = c.posterior.probability(part), c.budget.share(part)
        if p >= rules.named and c.budget.speed_rmse * float(np.sqrt(share)) >= rules.drift:
            force, sizes = c.posterior.force(part), dict[str, Size]()
            if part == EACH_DRIVE:
                force, sizes = _constants(c)
            f = _nameless(c, part, p, share, force)
            out.append(replace(f, parameters=sizes, share_ci90=c.budget.ends(part)))
    return out


def _of_rest(c: Compared, rules: Rules) -> list[Finding]:
    """The largest unnamed part, if the simulator's error exceeds the tolerance and nothing else was found: a
    slow or accumulating part, one that changes within seconds, or one that follows recorded channels without
    being a mechanism. Its probability is that no name acts: what several names share is no nameless force."""
    b = c.budget
    unexplained = b.force(LEFT_OVER, c.given.residual)
    each = {
        SLOW: (b.share(SLOW) + b.persistent, b.force(SLOW, c.given.residual) + unexplained),
        LEFT_OVER: (b.share(LEFT_OVER) - b.persistent, unexplained),
        UNKNOWN: (b.share(UNKNOWN), b.force(UNKNOWN, c.given.residual)),
    }
    part = max(each, key=lambda part: each[part][0])
    share, force = each[part]
    p = c.posterior.nameless()
    large = b.speed_rmse * float(np.sqrt(max(share, 0.0))) >= rules.drift
    return [_nameless(c, part, p, share, force)] if b.parts and large and p >= rules.named else []


def _nameless(c: Compared, part: str, p: float, share: float, force: Array) -> Finding:
    """A part of the budget as a finding without a name, with the signal to record to find its cause."""
    named = Named(UNKNOWN, Tree({UNKNOWN: p}), 0.0, force)
    f = _finding(c, named, Kind.PHYSICS, wording.DRIFT[part], force)
    record = wording.to_record(part, grade=c.regression.e.has("grade") or c.regression.e.has(FELT))
    return replace(f, separating_manoeuvre=record, share_of_error=share)


def _constants(c: Compared) -> tuple[Array, dict[str, Size]]:
    """The constant force of each fitted drive relative to the median drive: the force (n,), m/s^2, and its
    size by drive, with the 95 % interval of the draws that include it."""
    e, p = c.regression.e, c.posterior
    fitted = [s for s in e.drives if not s.held_out]
    (block,) = (j for j, k in enumerate(p.of) if k.name == EACH_DRIVE)
    features = p.of[block].features[[s.start for s in fitted]]
    drawn = p.coefficients(block)[p.inside(EACH_DRIVE)] @ features.T
    drawn = drawn - np.median(drawn, axis=1, keepdims=True)
    force, sizes = np.zeros(len(e)), {}
    for s, own in zip(fitted, drawn.T, strict=True):
        force[s.rows] = own.mean()
        value, *ends = (float(e.unit.scale * x) for x in (own.mean(), *np.quantile(own, [0.025, 0.975])))
        sizes[f"force[{s.name}]"] = Size(value, e.unit.name, (ends[0], ends[1]), s.name)
    return force, sizes


def _of_parameter(c: Compared, named: Named, correction: Correction, rules: Rules) -> Finding | None:
    """A parameter error as the correction has it; None if its interval reaches what any simulator may be off
    by."""
    name, regression = named.name, c.regression
    exact = correction.fitted
    known = exact is not None and exact.places(name)
    change, sd = exact.change(name) if exact and known else c.posterior.change(name, named.given)
    wide = Z95 * sd
    if abs(change) - wide < rules.nearly_right:
        return None
    low, high = regression.e.vehicle.possible(name)
    ci95 = (max(change - wide, low), min(change + wide, high))
    sizes = {"relative_error": Size(change, "1", ci95)}
    if name in c.parameters:
        value, a, b = (c.parameters[name] * (1.0 + x) for x in (change, *ci95))
        sizes = {name: Size(value, PARAMETER_ERRORS[name].unit, (a, b))} | sizes
    force = np.nan_to_num(regression.e.sensitivity[name]) * change
    f = _finding(c, named, Kind.PARAMETER, wording.of_parameter(PARAMETER_ERRORS[name].says, change), force)
    manoeuvre = PARAMETER_ERRORS[name].manoeuvre
    return replace(f, parameters=sizes, depends_on=("all driving",), separating_manoeuvre=manoeuvre)


def of_fault(f: SensorFault) -> Finding:
    """The finding of a fault that is visible between sensors alone."""
    ci = (f.value - Z95 * f.se, f.value + Z95 * f.se)
    return Finding(
        Kind.SENSOR, f.effect, FAMILY[f.effect], f.effect, f.says, f.equation,
        {"value": Size(f.value, f.unit, ci)}, wording.SENSOR_MANOEUVRE, f.between, FAULT, FAULT,
        credible_set=(f.effect,), share_of_explainable_error=0.0,
    )  # fmt: skip


def _finding(
    c: Compared, named: Named, kind: Kind, says: str, force: Array, relative_sd: float | None = None
) -> Finding:
    """A finding with a force (n,), m/s^2, whose size is known to `relative_sd`, or as the draws have it. The
    probability of its family is that of the whole tree, where other findings may share it."""
    e, rules, first = c.fitted, c.regression.rules, named.name
    family = FAMILY.get(first, first)
    tree = c.names.tree if c.names.tree.names.get(first) == named.tree.names[first] else named.tree
    others = (n for n in named.tree.credible(rules.credible) if n != first)
    return Finding(
        kind,
        first,
        family,
        named.tree.stated(rules.stated),
        says,
        "",
        {},
        "",
        (),
        round(named.tree.names[first], 3),
        round(tree.families[family], 3),
        (first, *others),
        evidence_nats=round(named.nats, 1),
        strength=strength(e, force, _drawn(c, named) if relative_sd is None else 1.0 + relative_sd * NORMAL),
        force=force,
        in_drives=_drives(e, force),
    )


def _drawn(c: Compared, named: Named) -> Array | None:
    """The size of a force in each draw in which it acts (m,), relative to their mean; None if it has none."""
    if not named.given.any() or not np.any(named.force[c.posterior.regression.rows]):
        return None
    sizes = c.posterior.on_columns(named.name, named.force[:, None], named.given)[:, 0]
    return np.asarray(sizes / sizes.mean())


def _drives(e: Evidence, force: Array) -> tuple[str, ...]:
    """The fitted drives in which a force acts; empty if it acts in all."""
    seen = visible(e)
    own = {
        s.name: float(np.sqrt(np.mean(force[s.rows][seen[s.rows]] ** 2)))
        for s in e.drives
        if not s.held_out and seen[s.rows].any()
    }
    most = max(own.values(), default=0.0)
    there = tuple(name for name, rms in own.items() if rms > Limits.in_drive * most)
    return there if len(there) < len(own) else ()


def _with_shares(e: Evidence, found: Sequence[Finding], budget: Budget) -> list[Finding]:
    """The findings with their shares of the squared speeds that result from all their forces."""
    squares = [e.adds_up(f.force, budget.horizon_s) ** 2 if f.force is not None else 0.0 for f in found]
    total, out = sum(squares) or 1.0, []
    for f, x in zip(found, squares, strict=True):
        if f.share_of_error is None and budget.parts and f.force is not None:  # none between sensors
            f = replace(f, share_of_error=budget.share(f.family), share_ci90=budget.ends(f.family))
        out.append(replace(f, share_of_explainable_error=round(x / total, 3)))
    return out


def names_behind(recordings: Sequence[Recording], missing: Sequence[NotRecorded]) -> dict[str, str]:
    """For each mechanism whose effect an input that was not recorded may explain as well: that input. The
    gear counts as recorded if every recording has the engine speed, which determines it."""
    known = {"gear"} if all("engine_speed" in r.channels for r in recordings) else set()
    asked = {m.input for m in missing} - known
    behind = {m.effect: m.mistaken_for for m in (*LIBRARY.values(), *LIBRARY.own.values())}
    behind |= {p.name: p.mistaken_for for p in PARAMETER_ERRORS.values() if p.mistaken_for}
    return {name: lacks for name, lacks in behind.items() if lacks in asked}
