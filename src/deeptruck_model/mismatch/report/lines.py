"""The main sentences of a verdict, for terminal and page."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from deeptruck_core.signals import Said, Speed, printed
from deeptruck_core.vehicle_kinds import LEAST_SPEED
from deeptruck_model.mismatch.correction.fit_result import Interval, Strength
from deeptruck_model.mismatch.folders import CORRECTION, REFIT
from deeptruck_model.mismatch.mechanisms.families import FAMILY, LEFT_OVER, PARAMETER_ERRORS, UNKNOWN
from deeptruck_model.mismatch.posterior.budget import Part
from deeptruck_model.mismatch.posterior.events import Event
from deeptruck_model.mismatch.posterior.names import Node
from deeptruck_model.mismatch.prepare.drives import Rejection
from deeptruck_model.mismatch.rules import Limits
from deeptruck_model.mismatch.verdict.result import (
    Alternative,
    Answer,
    Conclusion,
    Finding,
    Kind,
    Size,
    Verdict,
)
from deeptruck_model.mismatch.verdict.wording import (
    BESIDE_MISSING,
    FELT_STEP,
    ROOT,
    SETTLE,
    digits,
    opened,
    percent,
    spoken,
)

HEADLINES = {
    Conclusion.NOTHING: "Nothing that matters is missing",
    Conclusion.UNDETERMINED: "Undetermined: no cause is established",
}
GOOD_ENOUGH = "the simulator is good enough"
LARGE = 0.05  # of the budget: a smaller part is not in the sentence
WIDE = 0.3  # of the budget: an interval from which its middle says nothing
WORTH_SAYING = 0.01  # of the recorded samples or of a parameter: what is less is among the details alone
SPEED_UNIT = "m/s"
MOST_DRIVES = 6  # whose sizes are in the headline
MOST_ALTERNATIVES = 3  # names that are in the headline
MOST_EVENTS = 3  # that are listed
MOST_SETS = 3  # of names that are in together, which are listed
QUESTIONS = {"data": "Data enough?", "simulator": "Simulator good enough?", "apply": "Apply the correction?"}


class Light(NamedTuple):
    """A question with its answer (yes, no, unsure) and the reason."""

    question: str
    answer: str
    reason: str


def headline(v: Verdict) -> str:
    """What is missing, in which drives, its share of the error, and the next step; no name where the
    simulator is good enough."""
    if together := _together(v):
        return f"{opened(together)} are wrong together: {_next_step(v)}"
    if not v.findings:
        count = sum(not x.other_shift for x in v.events)
        besides = f", but for {count} event{'s' * (count > 1)} of seconds" if count else ""
        step = f": {_next_step(v)}" if v.validated or v.data.doubts else ""
        return HEADLINES.get(v.kind, HEADLINES[Conclusion.UNDETERMINED]) + besides + step
    f = v.findings[0]
    if v.kind is Conclusion.NOTHING:
        may = "may be wrong" if f.kind is Kind.PARAMETER else "may be missing"
        what = f"{spoken(f.effect)} {may} ({percent(f.probability)})"
        return f"{opened(GOOD_ENOUGH)} for such drives, although {what}{_better_still(v)}"
    if _good_enough(v):
        own = next((one for one in v.findings if one.effect == UNKNOWN and one.in_drives), None)
        what = Said(_in_drives(v, own or f), f"; otherwise {GOOD_ENOUGH}")
        return Said(opened(what), _better_still(v))
    return Said(opened(Said(_larger(v), _in_drives(v, f))), f": {_next_step(v)}")


def _together(v: Verdict) -> str:
    """The parameters, two or more, that are all an offered correction changes; empty if it adds a force, or a
    name is stated."""
    if v.fit is None or v.offered != CORRECTION or any(f.stated == f.effect for f in v.findings):
        return ""
    forces = any(x.value for x in v.fit.corrected_forces.values())
    changed = [
        f"{spoken(n)} ({100.0 * x:+.0f} %)"
        for n, x in v.fit.corrected_parameters.items()
        if abs(x) >= WORTH_SAYING
    ]
    return "" if forces or len(changed) < 2 else f"{', '.join(changed[:-1])} and {changed[-1]}"


def _better_still(v: Verdict) -> str:
    """What to do although the simulator is good enough; empty if nothing is."""
    if v.data.doubts:
        return f"; but first {SETTLE}"
    return f"; better still: {_next_step(v)}" if v.validated else ""


def _good_enough(v: Verdict) -> bool:
    """Whether the simulator is good enough with its findings, and no sensor must be repaired."""
    good = v.advice.get("simulator")
    sound = all(f.kind is not Kind.SENSOR for f in v.findings)
    return sound and good is not None and good.answer is Answer.YES


def share_of(share: float, ends: Interval | None) -> str:
    """A share of the squared error, with its interval where that is too wide for one number."""
    if ends is not None and ends[1] - ends[0] > WIDE:
        return f"{percent(share)} ({100.0 * ends[0]:.0f} to {100.0 * ends[1]:.0f})"
    return percent(share)


def _part(p: Part) -> str:
    """A part of the budget with its share."""
    return f"{spoken(p.part)} {share_of(p.share, (p.low, p.high))}"


def _in_drives(v: Verdict, f: Finding) -> str:
    """A finding with the drives in which it acts and its share of the error."""
    drives = ", ".join(_drive(f, name) for name in f.in_drives)
    what = f"in {drives} alone of the fitted drives, {_what(f)}" if drives else _what(f) + _by_drive(f)
    share = ""
    if f.share_of_error is not None:
        share = f", {share_of(f.share_of_error, f.share_ci90)} of the squared error"
    where = Said(", mostly where ", f.in_condition) if f.in_condition else ""
    return Said(what, where, share)


def _larger(v: Verdict) -> str:
    """A part of the budget that no finding covers, all of whose interval is above the first one's share;
    none above a sensor, whose fault is removed from the budget."""
    f, parts = v.findings[0], v.budget.parts if v.budget is not None else ()
    stated = {f.family for f in v.findings} | {LEFT_OVER, UNKNOWN}
    other = max((p for p in parts if p.part not in stated), key=lambda p: p.low, default=None)
    if other is None or f.kind is Kind.SENSOR or other.low <= max(f.share_of_error or 0.0, LARGE):
        return ""
    return f"the largest part is {_part(other)}, of which no name is certain; "


def _drive(f: Finding, name: str) -> str:
    """A drive in which a finding acts, with its constant force if known."""
    size = f.by_drive.get(name)
    return f"{name} ({size.value:+.3g} {size.unit})" if size is not None else name


def _by_drive(f: Finding) -> str:
    """The size in each drive, if it differs between a few."""
    sizes = f.by_drive
    if not 1 < len(sizes) <= MOST_DRIVES or any(x.unit not in ("kg", "N") for x in sizes.values()):
        return ""
    return f" ({', '.join(f'{drive} {x.value:+,.0f} {x.unit}' for drive, x in sizes.items())})"


def sizes(v: Verdict) -> str:
    """Size of each finding with its 95 % interval, and its force while it acts, which has none; empty without
    findings."""
    each = []
    for f in v.findings:
        if found := list(_size(f)):
            given = "" if f.stated == f.effect or f.effect == UNKNOWN else "if "
            each.append(Said(f"{given}{spoken(f.effect)}: ", Said.joined(", ", found)))
    head = "Most probable sizes" + (
        " (95 % intervals in brackets): " if any(" (" in one for one in each) else ": "
    )
    return Said(head, Said.joined("; ", each), ".") if each else ""


def _size(f: Finding) -> Iterator[str]:
    """The error of a parameter; or the size in each drive, if these are few; or the fitted sizes, unless they
    are points of a curve, and the force."""
    if (error := f.parameters.get("relative_error")) is not None:
        own = f.parameters.get(f.effect)
        if own is not None and own.unit != "1":
            yield interval(error, own.value / (1.0 + error.value), own.unit, sign=True)
        yield interval(error, 100.0, "%", sign=True)
        return
    by_drive = f.by_drive
    if by_drive and len(by_drive) <= MOST_DRIVES:
        yield from (Said(drive, " ", interval(x, 1.0, x.unit, sign=True)) for drive, x in by_drive.items())
        return
    if not by_drive and not any(map(str.isdigit, "".join(f.parameters))):
        for name, x in f.parameters.items():
            if x.ci95 is not None:
                what = "" if name == "value" else f"{name.replace('_', ' ')} "
                yield Said(what, interval(x, 1.0, x.unit))
    if f.strength is not None:
        yield acting(f.strength)


def interval(x: Size, scale: float, unit: str, *, sign: bool = False) -> str:
    """A size times `scale` with its unit and interval."""
    value, *ends = (_number(scale * number, unit, sign) for number in (x.value, *(x.ci95 or ())))
    after = "" if unit in ("1", SPEED_UNIT) else f" {printed(unit)}"
    in_unit = value._replace(with_unit=True) if isinstance(value, Speed) else value
    return Said(in_unit, after, *((" (", ends[0], " to ", ends[1], ")") if ends else ()))


def _number(x: float, unit: str, sign: bool) -> str | Speed:
    """Three digits of a size, with a plus before positive ones if `sign`; one in m/s stays a speed."""
    return Speed(x, 3, with_unit=False, sign=sign) if unit == SPEED_UNIT else digits(x, sign=sign)


def _what(f: Finding) -> str:
    """The most probable statement."""
    if f.effect == UNKNOWN or (f.kind is Kind.SENSOR and f.stated == f.effect):
        return f.says
    if f.kind is Kind.SENSOR and f.stated != ROOT:
        return f"a sensor is wrong, most probably ({percent(f.probability)}) as {f.says}"
    name = spoken(f.effect if f.stated in (ROOT, f.effect) else f.stated)
    if f.in_log and f.stated == f.effect:
        return f.says
    each = " or ".join(map(_alternative, f.alternatives[:MOST_ALTERNATIVES]))
    if f.stated == ROOT:
        return each or f"{name} is most probable ({percent(f.probability)})"
    likely = f": {each}" if each else f", most probably {spoken(f.effect)} ({percent(f.probability)})"
    if f.kind is Kind.PARAMETER:
        return f"{name} of the simulator is wrong" if f.stated == f.effect else f"an error in {name}{likely}"
    what = f"{name} is missing" if f.stated == f.effect else f"an effect in {name} is missing{likely}"
    return f"{what} ({BESIDE_MISSING[f.missing_input]})" if f.missing_input else what


def _alternative(a: Alternative) -> str:
    """A name with its probability, the size that it needs, and how usual that is."""
    size, usual = "", ""
    if a.size is not None:
        percents = a.size.unit == "1"
        number = digits((100.0 if percents else 1.0) * a.size.value, sign=True)
        size = f", {number} {'%' if percents else printed(a.size.unit)}"
    if a.times_usual is not None:
        usual = ", usual" if a.times_usual <= 1.0 else f", {a.times_usual:.1f} times the usual"
    return f"{spoken(a.name)} ({percent(a.probability)}{size}{usual})"


def _next_step(v: Verdict) -> str:
    """The next step in a few words."""
    if v.data.doubts:
        return SETTLE
    if v.validated and v.fit is not None:
        step = "apply the refitted parameters" if v.fit.offered == REFIT else "apply the correction"
        asked = v.advice.get("apply")
        return f"see what to check, then {step}" if asked and asked.answer is Answer.UNSURE else step
    if any(f.kind is Kind.SENSOR for f in v.findings):
        return "repair the sensor" if v.findings[0].stated != ROOT else "see what to do"
    if v.findings[0].effect == UNKNOWN:
        return v.findings[0].separating_manoeuvre
    if v.findings[0].in_log:
        return FELT_STEP
    if v.findings[0].mass_by_drive:
        return "set the mass of each drive"
    if v.findings[0].alternatives:
        return f"to distinguish them, {v.findings[0].separating_manoeuvre}"
    return "see what to do"


def what(v: Verdict) -> Iterator[str]:
    """What was compared, and the error."""
    if v.data.compared:
        left_out = [f"{r.rule}, {percent(x)}" for r, x in shares_rejected(v) if x >= WORTH_SAYING]
        because = f" Left out: {'; '.join(left_out)}." if left_out else ""
        yield Said(
            f"{percent(v.data.compared)} of the recorded time is compared: not the first "
            f"{Limits.settle_s:g} s of a drive, nor below ", Speed(LEAST_SPEED), f".{because}"
        )  # fmt: skip
    b = v.budget
    if b is not None and b.parts:
        large = [_part(p) for p in b.parts if p.share >= LARGE]
        yield Said(
            "Along the fitted drives the simulator is off by ", Speed(b.speed_rmse),
            f" after up to {b.horizon_s:.0f} s. Shares of the squared error: {', '.join(large)}."
        )  # fmt: skip
    for other_shift, head in (
        (False, "Events, which act for seconds: "),
        (True, "The simulator shifts at another moment, which says nothing of forces: "),
    ):
        if own := [x for x in v.events if x.other_shift is other_shift]:
            more = len(own) - MOST_EVENTS
            listed = Said.joined("; ", map(event, own[:MOST_EVENTS]))
            yield Said(head, listed, f"; {more} more." if more > 0 else ".")
    for w in v.witnesses[:3]:
        share, part = percent(w.share), spoken(w.part)
        yield f"The channel {w.channel} predicts {share} of the part '{part}' on drives left out."


def event(x: Event) -> str:
    """An event: its place, its change of speed, the channels that move unusually, and its name, or those that
    it may have."""
    change = " gained" if x.speed_change > 0.0 else " lost"
    unusual = f", with an unusual {' and '.join(map(spoken, x.channels))}" if x.channels else ""
    name = f", {spoken(x.name)}" if x.name else ""
    perhaps = " or ".join(f"{spoken(n.name)} {percent(n.probability)}" for n in x.possible)
    if perhaps and not x.name:
        name = f", perhaps {perhaps}"
    when = f"{x.recording}, {x.start_s:.0f} to {x.end_s:.0f} s: "
    return Said(when, Speed(abs(x.speed_change)), change, unusual, name)


def shares_rejected(v: Verdict) -> list[tuple[Rejection, float]]:
    """What each rule rejected, with its share of the recorded samples."""
    return [(r, r.samples / v.data.recorded) for r in v.data.rejected] if v.data.recorded else []


def refitted(v: Verdict) -> Iterator[str]:
    """The error of each simulator along held-out drives."""
    if v.fit is None or v.fit.errors is None:
        return
    e = v.fit.errors
    corrected = (", corrected ", Speed(e.after.speed)) if v.fit.corrected else ()
    yield Said(
        f"Held-out drives, free runs of {v.fit.horizon_s:.0f} s: as given off by ", Speed(e.before.speed),
        ", with parameters refitted alone ", Speed(e.parameters_only.speed), *corrected, "."
    )  # fmt: skip


def contains(v: Verdict, *, refit: bool = False) -> Iterator[str]:
    """Each part of the offered simulator, or of the `refit`, with its size, and whether the first finding's
    name is none of them; without an offer the parameters whose interval in the refit excludes the given
    value, unless findings state them."""
    if v.fit is None:
        return
    offered = REFIT if refit else v.offered
    if offered == CORRECTION:
        changed = [(n, x) for n, x in v.fit.corrected_parameters.items() if abs(x) >= WORTH_SAYING]
        added = [(n, x) for n, x in v.fit.corrected_forces.items() if x.value]
        parts = [_changed(n, x, v.fit.corrected_intervals.get(n)) for n, x in changed]
        of = f", of the form of {', '.join(map(spoken, v.fit.forms))}" if v.fit.forms else ""
        forms = f"forces without an accepted name{of}"
        parts += [f"{forms if n == UNKNOWN else spoken(n)} {acting(x)}" for n, x in added]
        yield f"The correction contains: {'; '.join(parts)}."
        named = _named(v)
        if named and named not in {n for n, _ in (*changed, *added)}:
            yield (
                f"It does not contain {spoken(named)}, which the first line names: it reproduces the motion "
                "on such drives, and does not say what causes it."
            )
        return
    stated = {f.effect for f in v.findings if f.kind is Kind.PARAMETER}
    changes = {name: (r.change, r.change_ci95) for name, r in v.fit.refit.items()}
    if offered != REFIT:
        if v.kind is Conclusion.NOTHING:  # of the correction's fewer parameters one may be certain
            changes |= {
                n: (x, v.fit.corrected_intervals.get(n, (0.0, 0.0)))
                for n, x in v.fit.corrected_parameters.items()
            }
        changes = {
            n: (x, ends) for n, (x, ends) in changes.items() if n not in stated and ends[0] * ends[1] > 0.0
        }
    parts = [_changed(n, x, ends) for n, (x, ends) in changes.items() if abs(x) >= WORTH_SAYING]
    if parts:
        differ = "Fitted to these drives, parameters differ from the given ones"
        yield f"{'Refitted parameters' if offered == REFIT else differ}: {'; '.join(parts)}."


def _changed(parameter: str, change: float, ci95: tuple[float, float] | None) -> str:
    """A parameter's relative change with its interval."""
    ends = f" ({100.0 * ci95[0]:+.0f} to {100.0 * ci95[1]:+.0f})" if ci95 is not None else ""
    return f"{spoken(parameter)} {100.0 * change:+.0f} %{ends}"


def _named(v: Verdict) -> str:
    """The name that the first line gives as a cause in the truck; empty if there is none."""
    f = v.findings[0] if v.findings else None
    if f is None or f.kind is Kind.SENSOR or f.effect == UNKNOWN or v.kind is Conclusion.NOTHING:
        return ""
    return f.effect


def acting(x: Strength) -> str:
    """The strength of a force, with its interval."""
    mean, time = "mean" if x.one_way else "rms", percent(x.share_of_time)
    size = interval(Size(x.value, x.unit, x.ci95), 1.0, x.unit)
    return f"{mean} {size} while it acts, {time} of the time"


def how_probable(v: Verdict) -> Iterator[str]:
    """Each finding with its probabilities."""
    for f in v.findings:
        yield cause(f)
    if not v.findings and v.tree and v.kind is Conclusion.UNDETERMINED:
        yield candidates(v.tree)
    if len(v.explanations) > 1 and v.findings:
        sets = [
            f"{' and '.join(map(spoken, x.names)) or 'no mechanism'} {percent(x.probability)}"
            for x in v.explanations[:MOST_SETS]
        ]
        yield f"Sets that act together (a name's probability is the sum of its sets): {'; '.join(sets)}."


def candidates(tree: Sequence[Node]) -> str:
    """The most probable families, if none is stated."""
    top = [n for n in tree if n.parent == ROOT and n.node != "nothing"][:3]
    if not top:
        return "No mechanism explains the error, and these data do not identify its cause."
    split = ", ".join(f"{spoken(n.node)} {percent(n.probability)}" for n in top)
    return f"No part of the truck is at 90 %: {split}."


def cause(f: Finding) -> str:
    """The stated node and the probabilities below it."""
    if f.effect == UNKNOWN:
        share = f", {percent(f.share_of_error)} of the squared error" if f.share_of_error is not None else ""
        probable = f": probability {percent(f.probability)}" if f.stated != ROOT else ""
        return f"{opened(f.says)}{probable}{share}."
    if f.kind is Kind.SENSOR and f.stated == f.effect:
        return f"{opened(spoken(f.effect))}: {f.says}."
    split = f"{spoken(f.effect)} {percent(f.probability)}"
    own = [n for n in f.rivals if FAMILY.get(n, n) == f.family]
    split += f"; else {', '.join(map(spoken, own))}" if own else ""
    if others := [n for n in f.rivals if n not in own]:
        split += f"; or, of another part, {', '.join(map(spoken, others))}"
    beside = f"; {BESIDE_MISSING[f.missing_input]}" if f.missing_input else ""
    return f"{opened(spoken(f.family))}, {percent(f.family_probability)}: {split}{beside}."


def doubtful(v: Verdict) -> Iterator[str]:
    """One line for each doubt about an input, which comes before anything that was found with it."""
    yield from (f"Doubtful input: {doubt}" for doubt in v.data.doubts)


def not_recorded(v: Verdict) -> Iterator[str]:
    """One line for each input that was not recorded: the consequence, and the signal to record."""
    for m in v.not_recorded:
        found = ""
        if m.share_of_time:
            share = percent(m.share_of_time)
            found = f" It was found to act in {share} of the time; these rows are not compared."
        elif m.share_of_time is not None:
            found = " It was searched for and not found."
        signal = m.signal.replace("`", "")
        yield f"{opened(spoken(m.input))} was not recorded. {m.hides}{found} Record: {signal}."


def what_to_do(v: Verdict) -> Iterator[str]:
    """The next steps: the simulator, the sensors, then what to drive and to record."""
    if v.budget is None and "data" in v.advice:
        yield Said(opened(v.advice["data"].reason), ".")
    for f in v.findings:
        if f.kind is Kind.SENSOR:
            if f.stated != ROOT:
                yield f"Repair it at its sensor or clock before you record more: {f.says}."
            else:
                yield f"Check before you record more whether {f.says} ({percent(f.probability)})."
        elif f.kind is Kind.PARAMETER and not v.validated:
            yield _check(v, f)
        elif f.mass_by_drive and not v.validated:
            masses = ", ".join(f'"{drive}": {mass:.0f}' for drive, mass in f.mass_by_drive.items())
            given = "Set" if f.stated == f.effect else f"If it is {spoken(f.effect)}, set"
            yield f"{given} the simulator's mass for each drive, kg: {{{masses}}}."
    if v.data.doubts:
        yield f"{opened(SETTLE)} and compare again; apply nothing before."
        return
    if v.validated:
        refit = v.fit is not None and v.fit.offered == REFIT
        offer = "the refitted parameters alone" if refit else "the correction"
        sensor = any(f.kind is Kind.SENSOR for f in v.findings)
        yield f"{'Then apply' if sensor else 'Apply'} {offer}: the command writes a simulator of its own."
    elif v.kind is Conclusion.NOTHING and not any(f.kind is Kind.PARAMETER for f in v.findings):
        yield "Use the simulator as it is."
    manoeuvres = dict.fromkeys(
        f.separating_manoeuvre for f in v.findings if f.separating_manoeuvre and f.rivals
    )
    yield from (f"{opened(f.separating_manoeuvre)}." for f in v.findings if f.effect == UNKNOWN)
    for manoeuvre in list(manoeuvres)[:2]:
        yield f"To separate the names: {manoeuvre}."
    if v.not_recorded:
        yield "Record what is listed as not recorded, with the signals named there."


def _check(v: Verdict, f: Finding) -> str:
    """What to do about a parameter that may be wrong; for drives in which it hardly matters, nothing."""
    name = PARAMETER_ERRORS[f.effect].says
    if v.kind is not Conclusion.NOTHING:
        return f"Check the simulator's {name}: {f.says}."
    error = f.parameters["relative_error"]
    may = interval(error, 100.0, "%", sign=True)
    use = f"Use the simulator as it is for such drives. Its {name} may be off by "
    each = v.fit.at_high_speed.get(f.effect) if v.fit is not None else None
    if each is None:
        return Said(use, may, ": check it where it matters more.")
    ends = sorted(each * x for x in error.ci95 or ())
    added = Size(each * error.value, SPEED_UNIT, (ends[0], ends[1]) if ends else None)
    change = interval(added, 1.0, SPEED_UNIT, sign=True)
    return Said(
        use, may, "; on a level road at ", Speed(Limits.high_speed), " that adds up to ", change,
        f" after {Limits.horizons_s[0]:g} s: check it before such drives.",
    )  # fmt: skip


def lights(v: Verdict) -> list[Light]:
    """A user's three main questions with their answers."""
    return [Light(QUESTIONS[name], a.answer, a.reason) for name, a in v.advice.items()]


def lines(v: Verdict) -> list[str]:
    """All sentences, for the terminal."""
    answers = [Said(one.question, f" {one.answer} (", one.reason, ").") for one in lights(v)]
    middle = (*what(v), *how_probable(v), *refitted(v), *what_to_do(v))
    sized = [said] if (said := sizes(v)) else []
    return [Said(headline(v), "."), *doubtful(v), *contains(v), *sized, *not_recorded(v), *middle, *answers]
