"""The whole job: check the data, locate, name, model, show the fit improve, write the verdict."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from importlib.util import find_spec

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from deeptruck_model.checks import mass
from deeptruck_model.errors import InputError
from deeptruck_model.mismatch import locate
from deeptruck_model.mismatch.active_fault import active_fault
from deeptruck_model.mismatch.correction import correction
from deeptruck_model.mismatch.correction.own_error import acts_there_alone, differs, off_for_long
from deeptruck_model.mismatch.correction.worth import noticed, refitted_is_much_better
from deeptruck_model.mismatch.data import checks, speed_unit
from deeptruck_model.mismatch.data.one_road import on_a_road_of_its_own, on_one_road, without_a_place
from deeptruck_model.mismatch.data.prepared import (
    Prepared,
    each_once,
    learned,
    prepare,
    same_signals,
    too_little,
    unusable,
    with_held_out,
)
from deeptruck_model.mismatch.excluded import check_excluded
from deeptruck_model.mismatch.finding import Finding
from deeptruck_model.mismatch.fit_result import FitResult
from deeptruck_model.mismatch.posterior import linearised
from deeptruck_model.mismatch.posterior.causes import Explanation
from deeptruck_model.mismatch.posterior.modelled import Formula
from deeptruck_model.mismatch.posterior.windows import often_off
from deeptruck_model.mismatch.report import findings, identifiability, validation
from deeptruck_model.mismatch.report.given import of_these_drives
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.residual.gather import gather
from deeptruck_model.mismatch.residual.sensitivity import PARAMETERS
from deeptruck_model.mismatch.result import Conclusion, DataReport, Mismatch, Regime, Verdict
from deeptruck_model.mismatch.rules import Rules
from deeptruck_model.recordings import Recording
from deeptruck_model.simulators import MinimalSimulator, Simulator, completed
from deeptruck_model.vehicle_kinds import IMPOSSIBLE_ACCELERATION

Array = NDArray[np.float64]

COUNTS_AS_LEARNED = (
    "the simulator tells neither parameters nor forces, and keeps no recordings: it counts as a learned one, "
    "beside which less is claimed; tell them by parameters() and inside() (docs/simulators.md)"
)
NO_VEHICLE = 0.01  # of the samples: more is no jolt
IMPOSSIBLE = (
    "the simulator answers with more than {most:g} m/s^2 in {share:.2g} % of samples, as no vehicle does; "
    "see 'deeptruck-model check-simulator'"
)
FOR_LESS = "half the usual evidence of a name was asked for, as held-out drives show that something differs"
LEFT_OUT = "left out of the library, as was asked for: {}"
OWN_ROAD = "by their positions {} meet no other drive: if they did, check latitude and longitude"
NO_PLACE = "positions of {} are missing or do not fit the speed: where on the road these were is not known"
OTHER_GEAR = "the simulator drives in another gear than was recorded"
STRANGE = "the simulator has learned from no driving at such speeds, commands and slopes"
WITHOUT_FORMULA = "what has no name is told without a formula: pip install 'deeptruck[formula]'"
WITHOUT_MASS = (
    "forces are told per kilogram (m/s^2), as the simulator does not tell its mass; state it by --mass-kg"
)


def find_mismatch(
    simulator: MinimalSimulator,
    recordings: Sequence[Recording],
    held_out: Sequence[Recording] = (),
    *,
    seed: int = 0,
    with_unnamed: bool = False,
    exclude: Sequence[str] = (),
    say: Callable[[str], None] = lambda step: None,
    rules: Rules = Rules(),
    mass_kg: float | None = None,
) -> Mismatch:
    """Compare a simulator with recordings. On data that is merely poor the verdict is `undetermined`.

    `with_unnamed` puts what has no name into the corrected simulator too, as laws of the recorded signals.
    `exclude` leaves effects out of the library, for examinations of the tool. `rules` are the
    thresholds by which the verdict is reached. `mass_kg` is the mass of a simulator that does not tell its
    own: without it forces are told per kilogram.

    Raises InputError for what is no simulator, where simulator and recordings do not belong together, for an
    effect there is not, and for a mass that cannot be or is another than the simulator's.
    """
    check_excluded(exclude)
    simulator = completed(simulator)
    _check_mass(simulator, mass_kg)
    with threadpool_limits(1):
        return _find(simulator, recordings, held_out, seed, with_unnamed, list(exclude), say, rules, mass_kg)


def _check_mass(simulator: Simulator, mass_kg: float | None) -> None:
    if mass_kg is None:
        return
    mass(mass_kg)
    own = simulator.parameters().get("mass")
    if own is not None and abs(mass_kg - own) > 1e-6 * own:
        raise InputError(f"the simulator's own mass is {own:g} kg; leave --mass-kg out, or set its parameter")


@dataclass(frozen=True)
class Checked:
    """The recordings as they can be used, in the order in which they came, and what was wrong with them."""

    prepared: tuple[Prepared, ...]
    held_out: tuple[bool, ...]
    faults: tuple[checks.SensorFault, ...]
    data: DataReport
    caveats: tuple[str, ...]
    useless: str | None  # why nothing can be said

    def part(self, held_out: bool) -> list[Prepared]:
        return [p for p, out in zip(self.prepared, self.held_out, strict=True) if out == held_out]


def checked_drives(
    simulator: Simulator, recordings: Sequence[Recording], held_out: Sequence[Recording], rules: Rules
) -> Checked:
    same_signals(simulator, [*recordings, *held_out])
    fit, held, twice = each_once(recordings, held_out)
    drives, flags, caveats = with_held_out(fit, held, simulator.dt)
    drives, rejected = checks.clean(drives)
    measured = checks.acceleration_is_measured(drives)
    faults = checks.sensor_faults(drives, rules) if measured else []
    whole = _mended(simulator, drives, faults, measured)
    fitted = [p for p, out in zip(whole, flags, strict=True) if not out]
    if unusable(fitted, rejected) is None:
        speed_unit.check(simulator, whole)
        if scaled := speed_unit.faults(simulator, whole, rules):
            faults = [*faults, *scaled]
            whole = _mended(simulator, drives, faults, measured)
    prepared = on_one_road([learned(simulator, p) for p in whole])
    strange = sum(int((p.valid & ~q.valid).sum()) for p, q in zip(whole, prepared, strict=True))
    if strange:
        rejected = sorted([*rejected, checks.Rejection(STRANGE, strange)], key=lambda r: -r.samples)
    useless = unusable([p for p, out in zip(prepared, flags, strict=True) if not out], rejected)
    data = DataReport(tuple(rejected))
    lost = [NO_PLACE.format(", ".join(names))] if (names := without_a_place(prepared)) else []
    lost += [OWN_ROAD.format(", ".join(names))] if (names := on_a_road_of_its_own(prepared)) else []
    return Checked(prepared, tuple(flags), tuple(faults), data, (*twice, *caveats, *lost), useless)


def _mended(
    simulator: Simulator, drives: Sequence[Recording], faults: Sequence[checks.SensorFault], measured: bool
) -> list[Prepared]:
    return [prepare(checks.mended(r, faults), measured, simulator.interface.y) for r in drives]


def _find(
    simulator: Simulator,
    recordings: Sequence[Recording],
    held_out: Sequence[Recording],
    seed: int,
    with_unnamed: bool,
    exclude: list[str],
    say: Callable[[str], None],
    rules: Rules,
    mass_kg: float | None,
) -> Mismatch:
    say("checking the data")
    c = checked_drives(simulator, recordings, held_out, rules)
    if c.useless:
        return _useless(c)
    say("driving the simulator along the recordings")
    e = gather(simulator, c.prepared, c.held_out, seed=seed, rules=rules, mass_kg=mass_kg)
    _check_possible(e)
    if little := too_little(e):
        return _useless(replace(c, useless=little, data=_data(c, e)))
    e, driven = _explained(simulator, c, e, seed, with_unnamed, exclude, say)
    say("locating it")
    return _located(simulator, c, e, driven, exclude)


def _check_possible(e: Evidence) -> None:
    """Raises InputError where the simulator answers what no vehicle does."""
    beyond = float(np.mean(np.abs(e.simulated[e.valid]) > IMPOSSIBLE_ACCELERATION)) if e.valid.any() else 0.0
    if beyond > NO_VEHICLE:
        raise InputError(IMPOSSIBLE.format(most=IMPOSSIBLE_ACCELERATION, share=100.0 * beyond))


def _located(
    simulator: Simulator, c: Checked, e: Evidence, driven: correction.Driven, exclude: list[str]
) -> Mismatch:
    """What was found, in words, with where it acts, what correcting it is worth, and what limits that."""
    x = driven.explanation
    fit = replace(driven.fit, next_pass=next((c.road.ahead for c in x.causes if c.road is not None), None))
    found = _findings(simulator, c, e, x)
    causes = {place: f.cause for place, f in enumerate(found) if f.cause is not None}
    force = sum((cause.force for cause in causes.values()), start=np.zeros(len(e)))
    regimes = locate.regimes(e, force if causes else e.residual)
    if len(causes) == 1:  # else regimes are of several forces together
        found = [findings.with_regime(f, regimes) for f in found]
    unsaid = "" if found else _unsaid(simulator, c, e, driven, regimes)
    data = _data(c, e)
    verdict = Verdict(
        kind=Conclusion.UNDETERMINED if unsaid else _conclusion(found),
        findings=tuple(found),
        segments=tuple(locate.segments(e, causes)),
        regimes=tuple(regimes),
        fit=fit,
        data=data if found else replace(data, smallest_visible=identifiability.smallest_visible(e, x)),
        suspicions=tuple(map(findings.suspicion, driven.refuted)),
        caveats=(*c.caveats, *_caveats(e, found, fit, exclude), *([unsaid] if unsaid else [])),
    )
    return Mismatch(verdict, e, x, driven.errors, driven.corrected, c.prepared, tuple(exclude))


def _caveats(e: Evidence, found: Sequence[Finding], fit: FitResult, exclude: Sequence[str]) -> list[str]:
    """What limits the findings and their correction."""
    return [
        *([LEFT_OUT.format(", ".join(exclude))] if exclude else []),
        *([FOR_LESS] if found and e.rules.least_gain < Rules.least_gain else []),
        *([COUNTS_AS_LEARNED] if e.itself is None and not e.known_physics else []),
        *_without_mass(e, found),
        *([WITHOUT_FORMULA] if any(map(_nameless, found)) and not has_formulas() else []),
        *validation.caveats(fit, any(f.cause is not None for f in found), of_these_drives(found)),
    ]


def _explained(
    simulator: Simulator,
    c: Checked,
    given: Evidence,
    seed: int,
    with_unnamed: bool,
    exclude: list[str],
    say: Callable[[str], None],
) -> tuple[Evidence, correction.Driven]:
    """What was found and driven. What held-out drives refute leaves the library, and the search goes on once:
    another name may hold where the first had only followed the fitted drives. Where nothing is found though
    other parameters drive held-out drives much better, something differs: then a name needs less evidence.

    What held-out drives refute beside a learned simulator is its own discrepancy, and so would be the next.
    """
    e, x = linearised.explained(simulator, given, c.prepared, c.held_out, seed, exclude, say)
    say("correcting the simulator and driving it free")
    fitted, held_out = c.part(held_out=False), c.part(held_out=True)
    driven = correction.corrected_and_driven(simulator, e, x, fitted, held_out, with_unnamed)
    refuted = [f.acts_as for f in driven.refuted if f.term is not None]
    if refuted and e.model_discrepancy > 0.0:
        return e, driven
    if refuted:
        say("searching without what held-out drives speak against")
        without = [*exclude, *refuted]
        e, x = linearised.explained(simulator, given, c.prepared, c.held_out, seed, without, say)
        again = correction.corrected_and_driven(simulator, e, x, fitted, held_out, with_unnamed)
        return e, replace(again, refuted=(*driven.refuted, *again.refuted))
    if x.causes or not refitted_is_much_better(driven.fit):
        return e, driven
    say("searching for less, as held-out drives show that something differs")
    told = given.rules.told_gain
    less = replace(given, rules=replace(given.rules, least_gain=told, least_gain_learned=told))
    other, x = linearised.explained(simulator, less, c.prepared, c.held_out, seed, exclude, say)
    again = correction.corrected_and_driven(simulator, other, x, fitted, held_out, with_unnamed)
    return (other, again) if again.fit.validated else (e, driven)


def _unsaid(
    simulator: Simulator, c: Checked, e: Evidence, driven: correction.Driven, regimes: Sequence[Regime]
) -> str:
    """Why 'nothing missing' is no answer where there is no finding; empty where it is one."""
    measured, fit = c.prepared[0].measured_acceleration, driven.fit
    suspected = [f.effect for f in driven.refuted if noticed(f.force, e, fit.horizon_s)]
    return (
        differs(simulator, measured, fit, regimes, e.rules)
        or validation.no_name_is_sure(suspected)
        or validation.off_without_a_name(fit, often_off(e, driven.explanation.model))
        or acts_there_alone(e, driven.explanation.null)
        or off_for_long(e, driven.explanation.null, regimes)
    )


def _without_mass(e: Evidence, found: Sequence[Finding]) -> list[str]:
    forces = any(f.cause is not None for f in found)
    return [WITHOUT_MASS] if forces and not e.mass_known else []


def _useless(c: Checked) -> Mismatch:
    """What is left to say where the recordings tell nothing of the truck."""
    found = tuple(findings.from_sensor(f) for f in c.faults)
    kind = Conclusion.SENSOR if found else Conclusion.UNDETERMINED
    caveats = (*c.caveats, c.useless) if c.useless else c.caveats
    return Mismatch(Verdict(kind, found, data=c.data, caveats=caveats), None, None, {}, None, c.prepared)


def _findings(simulator: Simulator, c: Checked, e: Evidence, x: Explanation) -> list[Finding]:
    own = simulator.parameters()
    found = [findings.from_sensor(f) for f in c.faults]
    found += [findings.from_cause(cause, e, x, own) for cause in x.causes]
    found = [
        identifiability.checked(f, simulator, e, x.model) for f in identifiability.with_manoeuvres(found)
    ]
    found = [findings.with_formula(f, _formula(e, x), e.unit) if _nameless(f) else f for f in found]
    return [_with_fault(f, e, c.prepared) for f in found]


def _with_fault(f: Finding, e: Evidence, prepared: Sequence[Prepared]) -> Finding:
    """With the fault of the truck's own that was mostly active while the finding acts, where there is one."""
    fault = active_fault(f.cause.force, e, prepared) if f.cause is not None else None
    return f if fault is None else replace(f, active_fault=fault, says=f.says.and_then(str(fault)))


def _nameless(f: Finding) -> bool:
    return f.cause is not None and f.cause.predictable


def _formula(e: Evidence, x: Explanation) -> Formula | None:
    """None without the libraries of symbolic regression, which are an extra."""
    if not has_formulas():
        return None
    from deeptruck_model.mismatch.posterior import formula

    return formula.formula(e, x)


def has_formulas() -> bool:
    """Whether the libraries of symbolic regression are installed."""
    return all(find_spec(name) is not None for name in ("pyoperon", "sympy"))


def _data(c: Checked, e: Evidence) -> DataReport:
    if not e.other_gear:
        return c.data
    return replace(c.data, rejected=(*c.data.rejected, checks.Rejection(OTHER_GEAR, e.other_gear)))


def _conclusion(found: Sequence[Finding]) -> Conclusion:
    """The kind of the finding that explains most."""
    if not found:
        return Conclusion.NOTHING
    explaining = [f for f in found if f.share_of_explainable_error > 0]
    return Conclusion((explaining or found)[0].kind)


__all__ = ["PARAMETERS", "Mismatch", "find_mismatch"]
