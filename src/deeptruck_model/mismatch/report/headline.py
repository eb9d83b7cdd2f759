"""The verdict in a few sentences. `of` says what is claimed, as data; `sentences` puts it into words.

The first says what is missing, how large it is, how sure that is and what the correction is worth.
Terminal, page and demo print these same sentences. None has more than LONGEST words.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from enum import Enum, auto

from deeptruck_model.mismatch.correction.worth import (
    SpeedErrors,
    Worth,
    errors,
    worth,
)
from deeptruck_model.mismatch.finding import Finding, Kind
from deeptruck_model.mismatch.fit_result import Chosen, FitResult, HandedOver
from deeptruck_model.mismatch.mechanisms import LIBRARY
from deeptruck_model.mismatch.posterior.next_pass import NextPass
from deeptruck_model.mismatch.report.identifiability import most_tried
from deeptruck_model.mismatch.report.names import (
    LONGEST,
    NAMED,
    RIVALS,
    Name,
    either,
    fitting,
    in_a_row,
    spoken_effect,
)
from deeptruck_model.mismatch.report.wording import force, number, opened, percent, prose
from deeptruck_model.mismatch.residual.sensitivity import PARAMETERS
from deeptruck_model.mismatch.result import Conclusion, Verdict

HIDING = 0.03  # m/s^2 of a steady force: half of what tyres take
MOVED = 3  # parameters in one sentence
MUCH, LITTLE = 0.25, 0.05  # of the error left, in so little of the time, is worth a look

PARAMETERS_ALONE = "The correction is refitted parameters alone, which drove the fitted recordings best."
ALONE = "Where nobody tells it the {names}, as in training and the nodes, this error is {after} m/s."
BY_MEAN = "Of {} the correction holds the mean alone: what is there at one time or place is not in it."
SHOWN = {
    Worth.BETTER: "So what was found is worth more than other parameters.",
    Worth.AS_GOOD: "These drives do not tell which of the two predicts better.",
    Worth.WORSE: "So refitted parameters predict these drives better than what was found.",
}


class Claim(Enum):
    """What the verdict comes down to."""

    UNDETERMINED = auto()
    AGREES = auto()
    MUCH_COULD_HIDE = auto()
    OFF_WITHOUT_A_NAME = auto()  # something differs, and no name for it is sure
    FOUND = auto()


@dataclass(frozen=True)
class Headline:
    """What is claimed. `found` has what explains most first; `left_out` of it is not in the correction."""

    claim: Claim
    found: tuple[Name, ...] = ()
    left_out: tuple[Name, ...] = ()
    laws: bool = False  # the correction holds laws without a name too
    worth: Worth | None = None  # None where nothing was to be corrected
    errors: SpeedErrors | None = None
    seen: str = ""  # the smallest steady force that would have been seen; empty where that is not known
    seen_off: str = ""  # by how much parameters that are off would have been seen; empty likewise
    unseen_off: str = ""  # parameters that may be off by more than was tried
    reason: str = ""  # why nothing can be said
    next_pass: NextPass | None = None  # of a road that another pass shows
    scaled: bool = False  # forces stand for parameters, as the simulator has none
    moved: str = ""  # parameters that the correction moves though none of them is a finding
    instead: tuple[str, ...] = ()  # names in the correction that are no finding
    by_mean: tuple[str, ...] = ()  # names in the correction that belong to a time, a place or a recording
    alone: HandedOver | None = None  # the correction where nobody tells it all that it asks for
    suspected: tuple[str, ...] = ()  # where nothing was found: names for too little to be noticed
    most_of_it: str = ""  # likewise: where what is left is, if much of it lies in little of the time


def text(verdict: Verdict) -> str:
    """The sentences on a verdict as one text."""
    return " ".join(sentences(of(verdict)))


def of(verdict: Verdict) -> Headline:
    """What the verdict comes down to."""
    if verdict.kind is Conclusion.UNDETERMINED:
        reason = verdict.caveats[-1] if verdict.caveats else "the recordings do not tell"
        claim = Claim.OFF_WITHOUT_A_NAME if verdict.fit is not None else Claim.UNDETERMINED
        return Headline(claim, reason=reason)
    if not verdict.findings:
        return _nothing(verdict)
    found = sorted(verdict.findings, key=lambda f: _order(f, verdict.kind))
    simulated = [f for f in found if f.kind is not Kind.SENSOR]
    if not simulated:
        return Headline(Claim.FOUND, tuple(map(name, found)))
    fit = verdict.fit
    corrected = fit.corrected if fit is not None else ()
    return Headline(
        Claim.FOUND,
        tuple(map(name, found)),
        tuple(name(f) for f in simulated if f.effect not in corrected),
        fit is not None and fit.chosen is Chosen.LAWS,
        worth(fit),
        errors(fit),
        next_pass=fit.next_pass if fit is not None and fit.next_pass and fit.next_pass.shown else None,
        scaled=fit is not None and fit.scales_forces,
        moved=_moved(fit, {f.effect for f in found}),
        instead=tuple(n for n in corrected if n in LIBRARY and n not in {f.effect for f in found}),
        by_mean=fit.by_mean if fit is not None else (),
        alone=fit.handed_over if fit is not None and fit.validated else None,
    )


def _moved(fit: FitResult | None, found: Collection[str]) -> str:
    """Parameters in a correction by findings that are none, with their changes: 'drag area by -21 %'."""
    moved = fit.refitted.items() if fit is not None else ()
    told = [
        f"{spoken_effect(name)} by {100 * x:+.0f} %"
        for name, x in moved
        if name not in found and abs(x) >= 0.005
    ]
    return " and ".join(told if len(told) <= MOVED else [*told[:MOVED], "others"])


def _order(finding: Finding, main: Conclusion) -> tuple[bool, float]:
    return Conclusion(finding.kind) is not main, -finding.share_of_explainable_error


def _nothing(verdict: Verdict) -> Headline:
    seen = verdict.data.smallest_visible
    said = force(seen.always, seen.mass_kg) if seen is not None else ""
    if seen is not None and seen.rarely > seen.always:
        said += f", or {force(seen.rarely, seen.mass_kg)} for 2 % of the time,"
    claim = Claim.MUCH_COULD_HIDE if seen is not None and seen.always > HIDING else Claim.AGREES
    sizes = seen.parameters if seen else {}
    off = [f"{spoken_effect(p)} off by {number(100 * x)} %" for p, x in sizes.items() if x < most_tried(p)]
    more = [f"{spoken_effect(p)} by {number(100 * x)} %" for p, x in sizes.items() if x >= most_tried(p)]
    return Headline(
        claim,
        errors=errors(verdict.fit),
        seen=said,
        seen_off=_or(off[:MOVED]),
        unseen_off=_or(more[:MOVED]),
        suspected=tuple(dict.fromkeys(s.effect for s in verdict.suspicions)),
        most_of_it=_most_of_it(verdict),
    )


def _or(told: Sequence[str]) -> str:
    """'a, b or c'."""
    return " or ".join(filter(None, [", ".join(told[:-1]), *told[-1:]]))


def name(finding: Finding) -> Name:
    """A finding as it is named."""
    return Name(
        finding.effect,
        finding.kind,
        finding.cannot_be_told_from,
        _size(finding),
        percent(finding.probability),
    )


def _size(f: Finding) -> str:
    """How large it is: a force while it acts, what a parameter is, or by how much a sensor is off."""
    fitted = f.parameters.get("value" if f.kind is Kind.SENSOR else f.effect)
    if f.kind is not Kind.PHYSICS and fitted is not None:
        unit = "" if fitted.unit == "1" else f" {prose(fitted.unit)}"
        return f"{number(fitted.value)}{unit}{' fits' if f.kind is Kind.PARAMETER else ''}"
    if f.strength is None:
        return ""
    size = f"{number(abs(f.strength.value))} {prose(f.strength.unit)}"
    return size if f.strength.mostly else f"{size} while it acts"


def sentences(h: Headline) -> list[str]:
    """What is claimed, then what is shown of the correction: sentences of at most LONGEST words."""
    if h.claim is Claim.UNDETERMINED:
        return ["Nothing can be said yet.", f"{opened(prose(h.reason))}."]
    if h.claim is Claim.OFF_WITHOUT_A_NAME:
        return ["No cause can be named.", f"{opened(prose(h.reason))}."]
    if h.claim is Claim.FOUND:
        return [*_found(h), *_shown(h), *_again(h.next_pass)]
    left = [h.most_of_it] if h.most_of_it else []
    beside = [*_seen_off(h), *_still_off(h.errors), *left, *_suspected(h.suspected)]
    if h.claim is Claim.AGREES:
        return [_agrees(h.seen), *beside]
    seen = [f"A steady force above {h.seen} would have been seen."] if h.seen else []
    none = "Nothing was found, but these recordings would not show a small effect."
    return [none, *seen, *beside]


def _still_off(e: SpeedErrors | None) -> list[str]:
    """What noise, and all that is too little to be seen, make of free runs."""
    if e is None:
        return []
    return [f"Its free runs of {number(e.horizon_s)} s on held-out recordings are {number(e.given)} m/s off."]


def _suspected(effects: Sequence[str]) -> list[str]:
    return [f"Suspected, and too little to be noticed: {either(effects, NAMED)}."] if effects else []


def _seen_off(h: Headline) -> list[str]:
    seen = [f"So would {h.seen_off}."] if h.seen_off else []
    return [*seen, *([f"Not so {h.unseen_off}, the most that was tried."] if h.unseen_off else [])]


def _agrees(seen: str) -> str:
    said = "Nothing missing was found"
    return f"{said}; a steady force above {seen} would have been seen." if seen else f"{said}."


def _most_of_it(verdict: Verdict) -> str:
    """Where the error is that is left, if much of it lies in little of the time; else empty."""
    most = max(verdict.regimes, key=lambda r: r.share_of_error, default=None)
    if most is None or most.share_of_error < MUCH or most.share_of_time > LITTLE:
        return ""
    time = percent(most.share_of_time)
    return f"Of its error {percent(most.share_of_error)} is in {time} of the time, where {most.where}."


def _found(h: Headline) -> list[str]:
    """What was found, in as many names as a sentence holds; sensors in a sentence of their own."""
    sensors = [n for n in h.found if n.kind is Kind.SENSOR]
    others = [n for n in h.found if n.kind is not Kind.SENSOR]
    if not others:
        at_fault = "A sensor is at fault, not the truck model"
        return [_detailed(sensors, lambda s, n, r: f"{at_fault}: {in_a_row(s, n, r)}.")]
    gain = _gain(h)
    said = [_detailed(others, lambda o, n, r: f"{_opening(o, n, r)}{gain}.")]
    if len(said[0].split()) > LONGEST:  # long names: what it is worth is a sentence of its own
        worth_it = f"{opened(gain.removeprefix('; '))}."
        said = [_detailed(others, lambda o, n, r: f"{_opening(o, n, r)}."), worth_it]
    if sensors:
        said.append(fitting(lambda n, r: f"Besides, a sensor is at fault: {in_a_row(_bare(sensors), n, r)}."))
    return said


def _bare(names: Sequence[Name]) -> list[Name]:
    return [replace(n, size="", sure="") for n in names]


def _detailed(names: Sequence[Name], say: Callable[[Sequence[Name], int, int], str]) -> str:
    """The sentence say(names, most, rivals) with as many names and rivals as LONGEST words hold beside the
    details of all of them or, where there is no room for these, of the first."""
    first = [*names[:1], *_bare(names[1:])]
    short = [replace(names[0], size=names[0].size.removesuffix(" while it acts")), *first[1:]]
    for most in range(NAMED, 0, -1):
        for rivals in range(RIVALS, -1, -1):
            for told in (names, first, short):
                said = say(told, most, rivals)
                if len(said.split()) <= LONGEST:
                    return said
    return fitting(lambda most, rivals: say(_bare(names), most, rivals))


def _gain(h: Headline) -> str:
    """What the correction is worth, as the end of the first sentence."""
    if h.worth is None:
        return ""
    if h.errors is None or h.worth in (Worth.NOT_DRIVEN, Worth.NOT_BETTER):
        return "; no correction is proven"
    falls = f"speed error falls from {number(h.errors.given)} to {number(h.errors.corrected)} m/s"
    if h.worth is Worth.PARAMETERS_ALONE:
        return f"; parameters refitted, {falls}"
    return f"; {'partly ' if h.left_out and not h.laws else ''}corrected, {falls}"


def _opening(found: Sequence[Name], names: int, rivals: int) -> str:
    physics = [n for n in found if n.kind is Kind.PHYSICS]
    parameters = [n for n in found if n.kind is Kind.PARAMETER]
    if any(_mixed(n) for n in found):
        return f"The simulator is off in {in_a_row(found, names, rivals, ' in ')}"
    if not parameters:
        return f"The simulator leaves out {in_a_row(physics, names, rivals)}"
    off = f"{in_a_row(parameters, names, rivals)} {'is' if len(parameters) == 1 else 'are'} off"
    if not physics:
        return f"No physics is missing, but the simulator's {off}"
    return f"The simulator's {off}, and it leaves out {in_a_row(physics, names, rivals)}"


def _mixed(name: Name) -> bool:
    """Whether it is undecided between a parameter that is off and physics that is left out."""
    if name.kind is Kind.PARAMETER:
        physics = [r for r in name.rivals if r in LIBRARY and LIBRARY[r].kind == "missing_physics"]
        return any(r not in PARAMETERS for r in physics)
    return any(r in PARAMETERS and r not in LIBRARY for r in name.rivals)


def _shown(h: Headline) -> list[str]:
    """What the held-out drives show of the correction, refitted parameters first."""
    if h.worth is None:
        return []
    if h.worth is Worth.NOT_DRIVEN:
        return ["No held-out drive is long enough without a gap to prove a correction."]
    if h.worth is Worth.NOT_BETTER:
        return ["No correction proved better on held-out recordings, so none may be applied."]
    assert h.errors is not None
    if h.worth is Worth.PARAMETERS_ALONE:
        return [f"{_runs(h.errors)}.", PARAMETERS_ALONE]
    said = []
    if h.left_out:
        said.append(fitting(lambda n, r: _not_in(h.left_out, n, h.laws)))
    elif h.laws:
        said.append("Laws without a name are in the correction too.")
    if h.instead:
        beside = " and ".join(map(spoken_effect, h.instead[:NAMED]))
        said.append(f"It holds {beside} instead, which comes near to it and is no finding.")
    if h.moved:
        said.append(f"Besides what was found, the correction moves {h.moved}.")
    if h.by_mean:
        said.append(BY_MEAN.format(" and ".join(map(spoken_effect, h.by_mean[:NAMED]))))
    other = f"with {'its forces scaled' if h.scaled else 'all parameters refitted'} instead it is"
    said.append(f"{_runs(h.errors)}; {other} {number(h.errors.refitted)} m/s.")
    return [*said, *_alone(h.alone), SHOWN[h.worth]]


def _alone(told: HandedOver | None) -> list[str]:
    if told is None:
        return []
    return [ALONE.format(names=" and the ".join(map(spoken_effect, told.without)), after=number(told.after))]


def _again(p: NextPass | None) -> list[str]:
    if p is None:
        return []
    left = f"{number(p.left)} of {number(p.rms)} m/s²"
    return [f"Another pass over the road shows it: on {p.km:.0f} km ahead it leaves {left}."]


def _runs(e: SpeedErrors) -> str:
    return f"This is the error of {number(e.horizon_s)} s free runs on held-out recordings"


def _not_in(left_out: Sequence[Name], names: int, laws: bool) -> str:
    alone = in_a_row([Name(n.effect, n.kind) for n in left_out], names, 0)
    if laws:
        return f"Laws stand for {alone} in the correction."
    return f"{opened(alone)} {'is' if len(left_out) == 1 else 'are'} not in the correction."
