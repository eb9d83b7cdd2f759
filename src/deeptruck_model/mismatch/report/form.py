"""The form in which a mechanism was fitted, where that is another than the known one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from deeptruck_model.mismatch.mechanisms import OWN, CandidateTerm
from deeptruck_model.mismatch.mechanisms.over_time import ELAPSED
from deeptruck_model.mismatch.mechanisms.variants import Gate, OwnCurve, PerRecording, Spline
from deeptruck_model.mismatch.residual.evidence import Evidence, ForceUnit
from deeptruck_model.mismatch.sentence import Named, Part

KNOWN = "the known form"


@dataclass(frozen=True)
class Summand:
    """The variable of a curve of its own, None for the known form; when its carrier is there, in words; and
    the regime of its own."""

    by: str | None
    when: str
    gate: Gate | None


def _summands(term: CandidateTerm) -> list[Summand]:
    shared = term.variant.gate  # told of the whole effect
    found = []
    for part in term.variant.parts:
        gate = None if shared is not None else part.gate
        for leaf in part.leaves:
            form = OWN[term.mechanism.effect][leaf.index] if isinstance(leaf, OwnCurve) else None
            found.append(Summand(form.by, form.when, gate) if form else Summand(None, "", gate))
    return list(dict.fromkeys(found))


def equation(term: CandidateTerm) -> str:
    """The equation of the form that was fitted: the mechanism's, or curves of its own and their sum."""
    summands, known = _summands(term), term.mechanism.equation
    if all(s.by is None for s in summands):
        return "; ".join([known, *_courses(term)])
    told = [f"f{k}({s.by})" if s.by else "F0" for k, s in enumerate(summands, 1)]
    ending = f";  F0: {known}" if "F0" in told else ""
    return f"F = {' + '.join(told)}{ending}"


def courses(term: CandidateTerm) -> str:
    """That a size was fitted to vary, where it was: the known form then tells not by what."""
    return "".join(f". Its {course}" for course in _courses(term))


def _courses(term: CandidateTerm) -> list[str]:
    splines = [leaf for leaf in term.variant.leaves if isinstance(leaf, Spline) and leaf.knots]
    along = {"size varies in time" if s.along == ELAPSED else "size varies along the road" for s in splines}
    own = any(isinstance(leaf, PerRecording) for leaf in term.variant.leaves)
    return [*sorted(along), *(["size is each recording's own"] if own else [])]


def at_places(term: CandidateTerm, e: Evidence) -> str:
    """That a profile is one for all drives, where it is, by what they are known to be at one place, and what
    a correction has of it."""
    if not term.variant.comes_again:
        return ""
    told = not np.array_equal(e["place"], e["distance"])
    by = "Places are told by positions" if told else "All drives are taken to start at one place, one way"
    own = [f"{first:.0f} to {last:.0f} m" for first, last in term.variant.places]
    where = f". It acts at {', '.join(own)} along the road" if own else ""
    elsewhere = "not" if own else "with its mean"
    return f"{where}. {by}. A correction has it on this road, and elsewhere {elsewhere}"


def curved(term: CandidateTerm, unit: ForceUnit) -> tuple[Part, ...]:
    """What is added up, where it is not the known form alone."""
    summands = _summands(term)
    if all(s.by is None for s in summands):
        return ()
    if len(summands) == 1:
        return (". It is ", *_summand(summands[0], unit))
    out: list[Part] = [". It is the sum of "]
    for k, summand in enumerate(summands):
        out += [" and " if k == len(summands) - 1 else ", " if k else "", *_summand(summand, unit)]
    return tuple(out)


def _summand(s: Summand, unit: ForceUnit) -> tuple[Part, ...]:
    what: tuple[Part, ...] = (KNOWN,) if s.by is None else ("a curve of its own over ", Named(s.by))
    when = f" {s.when}" if s.when else ""
    where = f" where {border(s.gate, unit)}" if s.gate is not None else ""
    return (*what, when, where)


def border(gate: Gate, unit: ForceUnit) -> str:
    """A regime in words: 'the speed is above 4.4 m/s'."""
    side, at = gate.side, gate.at
    return {
        "speed": f"the speed is {side} {at:.1f} m/s",
        "grade": f"the grade is {side} {100 * at:.1f} %",
        "lever": f"the engine turns {side} {at:.1f} rad per metre",
        "engine": f"the engine's force is {side} {unit.told(at)}",
        "engine torque": f"the engine's torque is {side} {at * unit.scale:.3g} {unit.of('N m')}",
    }[gate.signal]
