"""The sentences of a verdict, for terminal and page: the answer first, with one kind of percent in a line."""

from __future__ import annotations

from collections.abc import Iterator

from deeptruck_core.signals import Said, Speed, printed
from deeptruck_core.vehicle_kinds import LEAST_SPEED
from deeptruck_model.mismatch.correction.fit_result import Interval, Strength
from deeptruck_model.mismatch.folders import CORRECTION, REFIT
from deeptruck_model.mismatch.mechanisms.families import FAMILY, LEFT_OVER, PARAMETER_ERRORS, ROOT, UNKNOWN
from deeptruck_model.mismatch.posterior.budget import Part
from deeptruck_model.mismatch.posterior.events import Event
from deeptruck_model.mismatch.prepare.drives import Rejection
from deeptruck_model.mismatch.rules import Limits
from deeptruck_model.mismatch.verdict.result import Advice, Answer, Conclusion, Finding, Kind, Size, Verdict
from deeptruck_model.mismatch.verdict.wording import (
    BESIDE_MISSING,
    FELT_STEP,
    SETTLE,
    digits,
    opened,
    percent,
    spoken,
)

LARGE = 0.05  # of the budget: a smaller part is not in the sentence
WORTH_SAYING = 0.01  # of the recorded samples or of a parameter: what is less is among the details alone
NOTHING_KNOWN = 0.005  # of the budget: an interval that begins below says nothing of a part's size
SPEED_UNIT = "m/s"
MOST_DRIVES = 6  # whose sizes are said
MOST_NAMES = 2  # in the first line
MOST_EVENTS = 3  # that are listed
EVENTS = {  # whether the simulator shifts at another moment in them
    False: "Events, which act for seconds: ",
    True: "The simulator shifts at another moment, which says nothing of forces: ",
}
NOT_ASKED = Advice(Answer.UNSURE, "no cause is established")
QUESTIONS = {"data": "Data enough?", "simulator": "Simulator good enough?", "apply": "Apply the correction?"}


def headline(v: Verdict) -> str:
    """Whether the simulator is good enough or what is missing, where, and the next step."""
    good, f = v.kind is Conclusion.NOTHING or _good_enough(v), next(iter(v.findings), None)
    if parameters := _together(v):
        what = f"{', '.join(parameters[:-1])} and {parameters[-1]} are wrong together"
    elif f is None and good:
        count = sum(not x.other_shift for x in v.events)
        besides = f", but for {count} event{'s' * (count > 1)} of seconds" if count else ""
        what = f"nothing that matters is missing{besides}: the simulator is good enough for these drives"
    elif f is None:
        asked = v.advice.get("simulator", NOT_ASKED)
        enough = "the simulator is not good enough for these drives, and no cause is established"
        what = enough if asked.answer is Answer.NO else Said("undetermined: ", asked.reason)
    elif v.kind is Conclusion.NOTHING:
        may = "wrong" if f.kind is Kind.PARAMETER else "missing"
        name = f"{spoken(f.effect)} may be {may} ({percent(f.probability)})"
        what = f"the simulator is good enough for these drives, although {name}"
    elif good:
        what = Said(_in_drives(f), "; otherwise the simulator is good enough for these drives")
    else:
        what = Said(_in_drives(f), _larger(v, f))
    if good and not v.data.doubts and not v.validated:
        return opened(what)
    return Said(opened(what), "; better still: " if good and not v.data.doubts else ": ", _next_step(v))


def _together(v: Verdict) -> list[str]:
    """The parameters, two or more, that are all an offered simulator changes, which with them is good enough;
    none if a name is stated."""
    if v.fit is None or any(f.stated == f.effect for f in v.findings):
        return []
    changes: dict[str, float] = {}
    if v.offered == CORRECTION and not any(x.value for x in v.fit.corrected_forces.values()):
        changes = {n: x for n, x in v.fit.corrected_parameters.items() if abs(x) >= WORTH_SAYING}
    elif v.offered == REFIT and v.fit.errors is not None:
        sure = {n: r for n, r in v.fit.refit.items() if r.change_ci95[0] * r.change_ci95[1] > 0.0}
        whole = v.fit.errors.parameters_only.speed <= v.fit.tolerance
        changes = {n: r.change for n, r in sure.items() if whole and abs(r.change) >= WORTH_SAYING}
    return [_changed(n, x, None) for n, x in changes.items()] if len(changes) > 1 else []


def _good_enough(v: Verdict) -> bool:
    """Whether the simulator is good enough with its findings, and no sensor must be repaired."""
    good = v.advice.get("simulator")
    sound = all(f.kind is not Kind.SENSOR for f in v.findings)
    return bool(v.findings) and sound and good is not None and good.answer is Answer.YES


def _in_drives(f: Finding) -> str:
    """A finding, with the drives or the condition in which it acts where that is not all driving."""
    if f.mass_by_drive and 1 < len(f.by_drive) <= MOST_DRIVES:
        each = (f"{name} {sized(x, sign=True, ends=False)}" for name, x in f.by_drive.items())
        where = f" ({', '.join(each)})"
    else:
        where = f", in {', '.join(f.in_drives)} alone" if f.in_drives else ""
    return Said(_what(f), where, *((", mostly where ", f.in_condition) if f.in_condition else ()))


def _what(f: Finding) -> str:
    """What is stated; else the most probable names."""
    if f.stated == f.effect:
        if f.effect == UNKNOWN or f.kind is Kind.SENSOR or f.in_log:
            return f.says
        wrong = "of the simulator is wrong" if f.kind is Kind.PARAMETER else "is missing"
        return f"{spoken(f.effect)} {wrong}{_beside(f)}"
    if f.effect == UNKNOWN:
        return f"{f.says}, which no name explains"
    names = [(a.name, a.probability) for a in f.alternatives] or [(f.effect, f.probability)]
    said = [f"{spoken(n)} ({percent(p)})" for n, p in names[:MOST_NAMES]]
    more = len(names) - MOST_NAMES
    said += [f"{more} other{'s' * (more > 1)}"] if more > 0 else []
    return f"most probable cause: {', '.join(said[:-1])}{' or ' if said[:-1] else ''}{said[-1]}{_beside(f)}"


def _beside(f: Finding) -> str:
    return f" ({BESIDE_MISSING[f.missing_input]})" if f.missing_input else ""


def _larger(v: Verdict, f: Finding) -> str:
    """A part of the budget that no finding covers, all of whose interval is above the first one's share;
    none above a sensor, whose fault is removed from the budget."""
    stated = {f.family for f in v.findings} | {LEFT_OVER, UNKNOWN}
    parts = [p for p in (v.budget.parts if v.budget is not None else ()) if p.part not in stated]
    other = max(parts, key=lambda p: p.low, default=None)
    if other is None or f.kind is Kind.SENSOR or other.low <= max(f.share_of_error or 0.0, LARGE):
        return ""
    return f", and a larger part ({spoken(other.part)}) has no certain cause"


def _next_step(v: Verdict) -> str:
    """The next step in a few words."""
    f = next(iter(v.findings), None)
    if v.data.doubts:
        return SETTLE
    if v.validated:
        step = "apply the refitted parameters" if v.offered == REFIT else "apply the correction"
        if f is not None and f.mass_by_drive:
            step = f"set the mass of each drive; for others {step}"
        asked = v.advice.get("apply")
        return f"see what to check, then {step}" if asked and asked.answer is Answer.UNSURE else step
    if f is None:
        return "see what to do"
    if f.kind is Kind.SENSOR:
        return "repair the sensor" if f.stated != ROOT else "see what to do"
    if f.in_log:
        return FELT_STEP
    if f.mass_by_drive:
        return "set the mass of each drive"
    if not f.separating_manoeuvre:
        return "see what to do"
    return f.separating_manoeuvre if f.effect == UNKNOWN else f"to confirm it, {f.separating_manoeuvre}"


def contains(v: Verdict, *, refit: bool = False) -> Iterator[str]:
    """Each part of the offered simulator, or of the `refit`, with its size, and whether the first finding's
    name is none of them."""
    if v.fit is None:
        return
    if not refit and v.offered == CORRECTION:
        changed = {n: x for n, x in v.fit.corrected_parameters.items() if abs(x) >= WORTH_SAYING}
        added = {n: x for n, x in v.fit.corrected_forces.items() if x.value}
        each = {
            f.effect for f in v.findings if f.by_drive
        }  # its sizes are those of drives, and not the offer's
        known = {
            f.effect: Said(f"{spoken(f.effect)} ", s)
            for f in v.findings
            if f.effect not in each and (s := size(f))
        }
        of = f", of the form of {', '.join(map(spoken, v.fit.forms))}" if v.fit.forms else ""
        names = {n: spoken(n) + ", in every drive as in their mean," * (n in each) for n in added}
        names[UNKNOWN] = f"forces without an accepted name{of}"
        parts = [known.get(n) or _changed(n, x, v.fit.corrected_intervals.get(n)) for n, x in changed.items()]
        parts += [known.get(n) or Said(names[n], " ", acting(x)) for n, x in added.items()]
        yield Said("The correction contains: ", Said.joined("; ", parts), ".")
        causes = [f.effect for f in v.findings[:1] if f.kind is not Kind.SENSOR and f.effect != UNKNOWN]
        if v.kind is not Conclusion.NOTHING and not {*causes} <= {*changed, *added}:
            yield (
                f"It does not contain {spoken(causes[0])}, which the first line names: it reproduces the "
                "motion on such drives, and does not say what causes it."
            )
    elif refit or v.offered == REFIT:
        refitted = [(n, r) for n, r in v.fit.refit.items() if abs(r.change) >= WORTH_SAYING]
        yield f"Refitted parameters: {'; '.join(_changed(n, r.change, r.change_ci95) for n, r in refitted)}."


def _changed(parameter: str, change: float, ci95: Interval | None) -> str:
    """A parameter's relative change with its interval."""
    ends = f" ({100.0 * ci95[0]:+.0f} to {100.0 * ci95[1]:+.0f})" if ci95 is not None else ""
    return f"{spoken(parameter)} {100.0 * change:+.0f} %{ends}"


def sizes(v: Verdict) -> str:
    """The size of each finding that the offered correction does not contain, with its 95 % interval."""
    of = v.fit if v.offered == CORRECTION else None
    held = {*of.corrected_parameters, *of.corrected_forces} if of is not None else set()
    each = [
        Said("" if f.stated == f.effect or f.effect == UNKNOWN else "if ", f"{spoken(f.effect)}: ", sized)
        for f in v.findings
        if f.effect not in held and (sized := size(f))
    ]
    said = Said("Most probable sizes (95 % intervals in brackets): ", Said.joined("; ", each), ".")
    return said if each else ""


def size(f: Finding) -> str:
    """A parameter's value and change; or the size in each drive, if these are few; or the constants, unless
    they are points of a curve, and the force. Empty if none is known."""
    if (error := f.parameters.get("relative_error")) is not None:
        value = f.parameters.get(f.effect)
        change = sized(error, sign=True)
        return change if value is None else f"{sized(value, ratio=False)}, {change}"
    if 0 < len(f.by_drive) <= MOST_DRIVES:
        return Said.joined(", ", (Said(n, " ", sized(x, sign=True)) for n, x in f.by_drive.items()))
    constants = {n: x for n, x in f.parameters.items() if x.ci95 is not None and not x.drive}
    curve = any(map(str.isdigit, "".join(f.parameters)))
    found = [
        Said("" if n == "value" or n in f.effect else f"{spoken(n.removesuffix(f'_{x.unit}'))} ", sized(x))
        for n, x in constants.items()
        if not curve and not f.by_drive
    ]
    return Said.joined(", ", [*found, *([acting(f.strength)] if f.strength is not None else [])])


def acting(x: Strength) -> str:
    """The strength of a force while it acts, with its interval."""
    return Said("mean " if x.one_way else "rms ", sized(Size(x.value, x.unit, x.ci95)), " while it acts")


def sized(x: Size, *, sign: bool = False, ends: bool = True, ratio: bool = True) -> str:
    """A size with its unit and interval; a `ratio` without a unit in percent."""
    scale, unit = (100.0, "%") if ratio and x.unit == "1" else (1.0, printed(x.unit).removeprefix("1"))
    interval = x.ci95 or () if ends else ()
    if x.unit == SPEED_UNIT:
        value, *around = (Speed(number, 3, with_unit=False, sign=sign) for number in (x.value, *interval))
        said = Said(value._replace(with_unit=True))
        return Said(said, " (", around[0], " to ", around[1], ")") if around else said
    number, *outer = (digits(scale * one, sign=sign) for one in (x.value, *interval))
    return f"{number} {unit}".rstrip() + (f" ({outer[0]} to {outer[1]})" if outer else "")


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
        large = [f"{spoken(p.part)} {share_of(p)}" for p in b.parts if p.share >= LARGE]
        yield Said(
            "Along the fitted drives the simulator is off by ", Speed(b.speed_rmse),
            f" after up to {b.horizon_s:.0f} s. Shares of the squared error: {', '.join(large)}."
        )  # fmt: skip
    for other_shift, head in EVENTS.items():
        if own := [x for x in v.events if x.other_shift is other_shift]:
            more = len(own) - MOST_EVENTS
            listed = Said.joined("; ", map(event, own[:MOST_EVENTS]))
            yield Said(head, listed, f"; {more} more." if more > 0 else ".")
    for w in v.witnesses[:3]:
        share, part = percent(w.share), spoken(w.part)
        yield f"The channel {w.channel} predicts {share} of the part '{part}' on drives left out."


def share_of(p: Part) -> str:
    """A part's share of the squared error; where its interval begins at zero that nothing is known of it."""
    return percent(p.share) if p.low >= NOTHING_KNOWN else f"not known (up to {percent(p.high)})"


def event(x: Event) -> str:
    """An event: its place, its change of speed, the channels that move unusually, and its name, or those that
    it may have."""
    change = " gained" if x.speed_change > 0.0 else " lost"
    unusual = f", with an unusual {' and '.join(map(spoken, x.channels))}" if x.channels else ""
    perhaps = " or ".join(f"{spoken(n.name)} {percent(n.probability)}" for n in x.possible)
    name = f", {spoken(x.name)}" if x.name else f", perhaps {perhaps}" if perhaps else ""
    when = f"{x.recording}, {x.start_s:.0f} to {x.end_s:.0f} s: "
    return Said(when, Speed(abs(x.speed_change)), change, unusual, name)


def shares_rejected(v: Verdict) -> list[tuple[Rejection, float]]:
    """What each rule rejected, with its share of the recorded samples."""
    return [(r, r.samples / v.data.recorded) for r in v.data.rejected] if v.data.recorded else []


def how_probable(v: Verdict) -> Iterator[str]:
    """Each finding with its probabilities; without one the most probable parts of the truck."""
    yield from map(cause, v.findings)
    if not v.findings and v.tree and v.kind is Conclusion.UNDETERMINED:
        top = [n for n in v.tree if n.parent == ROOT and n.node != "nothing"][:3]
        split = ", ".join(f"{spoken(n.node)} {percent(n.probability)}" for n in top)
        yield f"No name is established{'; parts of the truck: ' * bool(split)}{split}."


def cause(f: Finding) -> str:
    """The part of the truck and the names, with their probabilities."""
    if f.effect == UNKNOWN:
        return f"{opened(f.says)}" + (f": probability {percent(f.probability)}." if f.stated != ROOT else ".")
    if f.kind is Kind.SENSOR and f.stated == f.effect:
        return f"{opened(spoken(f.effect))}: {f.says}."
    split = f"{spoken(f.effect)} {percent(f.probability)}"
    own = [n for n in f.rivals if FAMILY.get(n, n) == f.family]
    split += f"; else {', '.join(map(spoken, own))}" if own else ""
    if others := [n for n in f.rivals if n not in own]:
        split += f"; or, of another part, {', '.join(map(spoken, others))}"
    return f"{opened(spoken(f.family))}, {percent(f.family_probability)}: {split}{_beside(f)}."


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
    """The next steps: sensors, parameters and masses, the correction, then what to drive or to record."""
    if v.budget is None and "data" in v.advice:
        yield Said(opened(v.advice["data"].reason), ".")
    for f in v.findings:
        if f.kind is Kind.SENSOR and f.stated != ROOT:
            yield f"Repair it at its sensor or clock before you record more: {f.says}."
        elif f.kind is Kind.SENSOR:
            yield f"Check before you record more whether {f.says} ({percent(f.probability)})."
        elif f.kind is Kind.PARAMETER and not v.validated:
            yield _check(v, f)
        elif f.mass_by_drive:
            masses = ", ".join(f'"{drive}": {mass:.0f}' for drive, mass in f.mass_by_drive.items())
            given = "Set" if f.stated == f.effect else f"If it is {spoken(f.effect)}, set"
            yield f"{given} the simulator's mass for each drive, kg: {{{masses}}}."
    if v.data.doubts:
        yield f"{opened(SETTLE)} and compare again; apply nothing before."
        return
    if v.validated:
        offer = "the refitted parameters alone" if v.offered == REFIT else "the correction"
        sensor = any(f.kind is Kind.SENSOR for f in v.findings)
        yield f"{'Then apply' if sensor else 'Apply'} {offer}: the command writes a simulator of its own."
    elif v.kind is Conclusion.NOTHING and not v.findings:
        yield "Use the simulator as it is."
    unsure = [f for f in v.findings if f.kind is not Kind.SENSOR and (f.rivals or not v.validated)]
    steps = dict.fromkeys(f.separating_manoeuvre for f in unsure if f.separating_manoeuvre)
    for step in list(steps)[:MOST_NAMES]:
        named = [spoken(f.effect) for f in unsure if f.separating_manoeuvre == step and f.effect != UNKNOWN]
        yield f"To confirm {' and '.join(named)}: {step}." if named else f"{opened(step)}."


def _check(v: Verdict, f: Finding) -> str:
    """What to do about a parameter that may be wrong, with what it makes where drives are faster."""
    if v.kind is not Conclusion.NOTHING:
        return f"Check the simulator's {PARAMETER_ERRORS[f.effect].says}: {f.says}."
    error = f.parameters["relative_error"]
    use = f"Use the simulator as it is for such drives. Its {PARAMETER_ERRORS[f.effect].says} may be off by "
    each = v.fit.at_high_speed.get(f.effect) if v.fit is not None else None
    if each is None:
        return f"{use}{sized(error, sign=True)}: check it where it matters more."
    ends = sorted(each * x for x in error.ci95 or ())
    added = Size(each * error.value, SPEED_UNIT, (ends[0], ends[1]) if ends else None)
    return Said(
        use, sized(error, sign=True), "; on a level road at ", Speed(Limits.high_speed), " that adds up to ",
        sized(added, sign=True), f" after {Limits.horizons_s[0]:g} s: check it before such drives.",
    )  # fmt: skip


def lines(v: Verdict) -> list[str]:
    """All sentences, for the terminal."""
    answers = [Said(f"{QUESTIONS[name]} {a.answer} (", a.reason, ").") for name, a in v.advice.items()]
    sized = [said] if (said := sizes(v)) else []
    middle = (*what(v), *how_probable(v), *what_to_do(v))
    return [Said(headline(v), "."), *doubtful(v), *contains(v), *sized, *not_recorded(v), *middle, *answers]
