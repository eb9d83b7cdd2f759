"""Findings as people and programs read them: sentences, sizes and groups."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from deeptruck_model.mismatch.data.checks import SensorFault
from deeptruck_model.mismatch.finding import Finding, Kind, Rival, Size, Suspicion
from deeptruck_model.mismatch.mechanisms import (
    LIBRARY,
    CandidateTerm,
    Mechanism,
)
from deeptruck_model.mismatch.posterior.causes import Cause, Explanation
from deeptruck_model.mismatch.posterior.modelled import Formula
from deeptruck_model.mismatch.report.forces import (
    AT_ITS_MOMENTS,
    Told,
    by_likeness,
    slow,
    strength,
    strength_of,
    time_varying,
    unknown,
)
from deeptruck_model.mismatch.report.form import at_places, border, courses, curved, equation
from deeptruck_model.mismatch.report.sizes import picked, sizes_of
from deeptruck_model.mismatch.residual.evidence import Evidence, ForceUnit
from deeptruck_model.mismatch.residual.noise import Z95
from deeptruck_model.mismatch.result import Regime
from deeptruck_model.mismatch.sentence import Named, Part, Sentence

MOVED_FAR = 0.05  # relative, of a parameter that is told beside a force
MUCH, SELDOM = 0.3, 3.0  # of a force, and times its share of the time, that tell where it acts


def _decided_by(cause: Cause) -> str | None:
    """What gave a slow force its name: that it came again with the road, or its size alone."""
    if cause.needed is None:
        return None
    if cause.road is None:
        return "physically possible size, not the fit"
    return "it comes again where the same road is driven again"


def with_regime(found: Finding, regimes: Sequence[Regime]) -> Finding:
    """The finding of a force that no signal predicts, with the driving in which much of it acts in little of
    the time, where there is such: the best clue that there is."""
    clue = next((r for r in regimes if r.share_of_error > max(MUCH, SELDOM * r.share_of_time)), None)
    if clue is None or found.cause is None or not found.cause.time_varying:
        return found
    share = f"{100.0 * clue.share_of_error:.0f} % of it is in {100.0 * clue.share_of_time:.0f} % of the time"
    signals = tuple(b.signal for b in clue.bounds)
    return replace(found, says=found.says.and_then(f"{share}, where {clue.where}"), depends_on=signals)


NAMES = {
    "mass": ("kg", "the mass differs from the simulator's"),
    "drag_area": ("m^2", "the drag area differs from the simulator's"),
    "rolling_resistance": ("1", "the rolling resistance differs from the simulator's"),
    "torque_gain": ("1", "the torque the engine gives for its command differs from the simulator's"),
    "brake_gain": ("1", "the force the brakes give for their command differs from the simulator's"),
}
TOLD_BY = {
    "mass": "accelerate with the same torque at a low and a high speed",
    "drag_area": "coast down from high speed on a flat road, both ways",
    "rolling_resistance": "coast down at low speed on a flat road, both ways",
    "torque_gain": "pull with steps of torque at one speed",
    "brake_gain": "brake with steps of command from one speed",
}
SHOWS, SHOWS_NOT = "shows it", "does not show it"
OTHER_FORM = ". It acts otherwise than in the form that is known here, and may be something else"


def from_sensor(fault: SensorFault) -> Finding:
    """A fault between two sensors, certain and beside all physics."""
    ci = (fault.value - Z95 * fault.se, fault.value + Z95 * fault.se)
    return Finding(
        kind=Kind.SENSOR,
        effect=fault.effect,
        says=Sentence.of(fault.says),
        equation=fault.equation,
        parameters={"value": Size(fault.value, fault.unit, ci)},
        probability=0.99,
        would_be_told_by=Sentence.of("move the truck by a known distance and compare each sensor with it"),
        depends_on=fault.between,
    )


def from_cause(cause: Cause, e: Evidence, explanation: Explanation, own: dict[str, float]) -> Finding:
    """A cause in words and numbers. `own` holds the simulator's parameters (SI) where it has them."""
    told = _told(cause, e, explanation, own)
    return Finding(
        kind=Kind(cause.kind),
        effect=cause.effect,
        says=told.says.and_then(*beside) if (beside := _beside(cause, e, explanation)) else told.says,
        equation=told.equation,
        parameters=told.parameters,
        probability=round(cause.believed, 3),
        would_be_told_by=told.would_be_told_by,
        depends_on=told.depends_on,
        cannot_be_told_from=tuple(cause.not_told_from),
        share_of_explainable_error=round(cause.share, 3),
        evidence_nats=round(cause.gain, 1),
        rivals=tuple(Rival(name, round(worse, 1)) for name, worse in cause.rivals[:8]),
        capped=_is_capped(cause),
        nearest=cause.nearest if cause.needed is None else None,
        laws_r2=told.laws_r2,
        decided_by=_decided_by(cause),
        road=cause.road if cause.needed is not None else None,
        engine_torque=None if cause.reported is None else SHOWS if cause.reported else SHOWS_NOT,
        strength=strength_of(cause, e),
        left_out=cause.left_out,
        cause=cause,
    )


def _beside(cause: Cause, e: Evidence, x: Explanation) -> tuple[Part, ...]:
    """Parameters that are no finding, were fitted beside a force and moved far."""
    if cause.kind != "missing_physics" or cause.needed is not None:
        return ()
    stated = {c.effect for c in x.causes}
    moved = {p: e.total_change(p, x.model.moved(p)) for p in sorted(x.model.free - stated)}
    told = [(Named(p), f" {100 * change:+.0f} %") for p, change in moved.items() if abs(change) >= MOVED_FAR]
    parts = [part for k, pair in enumerate(told) for part in ((" and ", *pair) if k else pair)]
    return ("its size holds beside ", *parts, ", which may make up for a part of it") if told else ()


def _is_capped(cause: Cause) -> bool:
    """Whether a name alone is told with less than its probability by forms."""
    by_forms = cause.kind == "missing_physics" and not cause.likeness
    return by_forms and cause.effect != "unknown" and not cause.not_told_from


def _told(cause: Cause, e: Evidence, explanation: Explanation, own: dict[str, float]) -> Told:
    if cause.needed is not None:
        return slow(cause)
    if cause.time_varying:
        return time_varying(cause, e)
    if cause.effect == "unknown":
        return unknown(cause, e, explanation)
    if cause.found_as is not None:
        return by_likeness(cause, e, explanation)
    if cause.term is None:
        return _parameter(cause, e, explanation, own)
    return _mechanism(cause, e, explanation)


def with_formula(finding: Finding, formula: Formula | None, force: ForceUnit) -> Finding:
    """The finding of a force without a name with the formula of its laws, where there is one."""
    if formula is None:
        return finding
    return replace(
        finding,
        equation=f"{force.symbol} = {formula.text}",
        depends_on=formula.drivers,
        formula_r2=round(formula.held_out_r2, 3),
    )


def _mechanism(cause: Cause, e: Evidence, explanation: Explanation) -> Told:
    term = cause.term
    assert term is not None
    m = term.mechanism
    return Told(
        Sentence.of(
            f"{m.says}: {strength(cause, e)}{_now_and_then(term)}{_confined(term, e.unit)}{courses(term)}"
            f"{at_places(term, e)}",
            *curved(term, e.unit),
            OTHER_FORM if cause.other_form else "",
            str(cause.left_out) if cause.left_out is not None else "",
            _reported(cause, m),
        ),
        equation(term),
        sizes_of(term, explanation.model, e) | picked(term, e),
        Sentence.of(m.told_by),
        (*m.depends_on, *_confined_by(term)),
    )


def _reported(cause: Cause, m: Mechanism) -> str:
    """What the engine's recorded torque says of a force; that it knows nothing of the wind is no news."""
    if cause.reported:
        return f". The engine's recorded torque {SHOWS}"
    if cause.reported is False and m.reported:
        return f". The engine's recorded torque {SHOWS_NOT}: its controller does not know of it"
    return ""


def _confined_by(term: CandidateTerm) -> list[str]:
    """The signal by which an effect is confined to a regime, where its mechanism does not depend on it."""
    gate = term.variant.gate
    return [gate.signal] if gate and gate.signal not in term.mechanism.depends_on else []


def _confined(term: CandidateTerm, force: ForceUnit) -> str:
    """In which regime alone an effect acts, where it does."""
    gate = term.variant.gate
    return f". It shows only where {border(gate, force)}" if gate is not None else ""


def _now_and_then(term: CandidateTerm) -> str:
    """That an effect was seen in a few windows alone, where it was."""
    spans = term.variant.spans
    seconds = sum(last - first for _, first, last in spans)
    times = "once" if len(spans) == 1 else f"{len(spans)} times"
    return f". It was seen now and then alone, {times} for {seconds:.0f} s together" if spans else ""


def _parameter(cause: Cause, e: Evidence, explanation: Explanation, own: dict[str, float]) -> Told:
    unit, says = NAMES[cause.effect]
    change = e.total_change(cause.effect, explanation.model.moved(cause.effect))
    sd = explanation.model.moved_sd(cause.effect) * (1.0 + e.moved.get(cause.effect, 0.0))
    base, unit = (own[cause.effect], unit) if cause.effect in own else (1.0, "of the simulator's")
    ci = (base * (1 + change - Z95 * sd), base * (1 + change + Z95 * sd))
    return Told(
        Sentence.of(
            f"{says}: {abs(100 * change):.1f} % {'more' if change > 0 else 'less'} (+-{196 * sd:.1f} %)"
        ),
        f"{cause.effect} -> {cause.effect} * (1 {change:+.3f})",
        {cause.effect: Size(base * (1 + change), unit, ci)},
        Sentence.of(TOLD_BY[cause.effect]),
        (cause.effect,),
    )


def suspicion(cause: Cause) -> Suspicion:
    """What was found, and withdrawn as held-out drives speak against it."""
    changes = LIBRARY.get(cause.effect) if cause.kind != Kind.PARAMETER else None  # a drag area may do so too
    told = changes.told_by if changes is not None else TOLD_BY.get(cause.effect)
    return Suspicion(cause.effect, round(cause.gain, 1), told or AT_ITS_MOMENTS)


def known(effect: str) -> bool:
    """Whether a name is one the tool can give."""
    return effect in LIBRARY or effect in NAMES or effect in ("unknown", "speed_scale", "acceleration_bias")
