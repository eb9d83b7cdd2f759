"""What a finding is not distinguishable from, and what decided for it nevertheless."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from deeptruck_model.mismatch.finding import Finding, Kind, Size
from deeptruck_model.mismatch.mechanisms import LIBRARY
from deeptruck_model.mismatch.report.drawing import remembered, words
from deeptruck_model.mismatch.residual.evidence import unit
from deeptruck_model.mismatch.result import Bound, Regime
from deeptruck_model.mismatch.rules import Rules
from deeptruck_model.mismatch.sentence import Named, Sentence

IDENTIFIER = re.compile(r"\b[a-z][a-z0-9]*(?:_[a-z0-9]+)+\b")
QUOTED = re.compile(r"((?<!\w)'[^']+'(?!\w))")
SPOKEN = {  # names that are no words of their own once the underscores are gone
    "rolling_resistance_speed": "rolling resistance that grows with speed",
    "rolling_resistance_warmup": "rolling resistance of cold tyres",
    "torque_derate": "derated torque",
    "command_rate_limit": "limited rate of the commands",
    "load_slosh": "sloshing load",
    "speed_scale": "scale of the speed sensor",
    "unknown": "unknown force",
}


SETTINGS = {  # what was chosen of a few: the names of the library are for programs
    "tau_s": "time constant",
    "decay_s": "time in which it fades to a third",
    "cooling_s": "time in which it cools to a third",
    "soak_s": "time constant of its soaking in",
    "cold_s": "time in which what is cold warms up to a third",
    "window_s": "length of the window",
    "length_m": "length",
    "frequency_hz": "frequency",
    "damping": "damping",
    "after_s": "time after which it begins",
    "keeps_s": "time in which what is kept falls to a third",
    "frees_m": "distance in which it comes free to a third",
    "limit_force": "engine force above which it cuts",
    "limit_torque": "engine torque above which it cuts",
    "limit_power": "engine power above which it cuts",
    "limit_speed": "speed above which it cuts",
    "limit_command": "engine command above which it cuts",
}


def force(acceleration: float, mass_kg: float | None) -> str:
    """A force per mass (m/s^2) in newtons where the mass is known."""
    if mass_kg is None:
        return f"{number(acceleration)} m/s²"
    return f"{number(acceleration * mass_kg)} N"


def number(x: float, step: float | None = None) -> str:
    """Plain digits: three significant ones without idle zeros, or rounded to `step`."""
    if not math.isfinite(x):
        return "unknown"
    if step is None:
        short = number(x, 10.0 ** (math.floor(math.log10(abs(x))) - 2)) if x else "0"
        return short.rstrip("0").rstrip(".") if "." in short else short
    if not 1e-6 < step < 1e9:
        return f"{x:.3g}"
    decimals = max(0, -math.floor(math.log10(step) + 1e-9))
    return f"{round(x / step) * step:.{decimals}f}"


def counted(count: int, what: str) -> str:
    """'1 recording', '2 recordings'."""
    return f"{count} {what}" if count == 1 else f"{count} {what}s"


def measured(value: float, unit: str, ci: Sequence[float] | None) -> str:
    """A size with its 95 % interval, in as many digits as the interval is worth."""
    unit = "" if unit in ("", "1") else f" {prose(unit)}"
    if ci is None or not all(math.isfinite(c) for c in ci) or ci[1] <= ci[0]:
        return f"{number(value)}{unit}"
    step = 10.0 ** (math.floor(math.log10((ci[1] - ci[0]) / 2)) - 1)
    return f"{number(value, step)}{unit} (95 %: {number(ci[0], step)} to {number(ci[1], step)})"


def percent(x: float) -> str:
    """A share or probability; never rounded to certainty."""
    if not math.isfinite(x):
        return "unknown"
    if x > 0.99:
        return "above 99 %"
    return "below 1 %" if x < 0.01 else f"{100 * x:.0f} %"


def spoken(name: str) -> str:
    """An effect's or signal's name within a sentence."""
    return SPOKEN.get(name, words(name))


def prose(text: str | Sentence) -> str:
    """Words for people: names spoken, and signs as they are printed; what is quoted, such as the name of a
    recording, stays as it is."""
    if isinstance(text, Sentence):
        return "".join(spoken(p.name) if isinstance(p, Named) else prose(p) for p in text.parts)
    parts = QUOTED.split(text)
    return "".join(part if k % 2 else _unquoted(part) for k, part in enumerate(parts))


def _unquoted(text: str) -> str:
    text = IDENTIFIER.sub(lambda found: spoken(found[0]), remembered(text))
    text = re.sub(r"\b\d+(\.\d+)?e[+-]\d+\b", lambda found: number(float(found[0])), text)
    return text.replace("+-", "±").replace("^2", "²").replace("^3", "³")


def condition(regime: Regime) -> str:
    """A regime as people say it: 'engine force per mass from 0.2 to 0.4 m/s² and speed above 20 m/s'."""
    return " and ".join(map(_condition, regime.bounds)) or "everywhere"


def _condition(b: Bound) -> str:
    if math.isinf(b.low):
        border = f"below {b.high:.3g}"
    elif math.isinf(b.high):
        border = f"above {b.low:.3g}"
    else:
        border = f"from {b.low:.3g} to {b.high:.3g}"
    return prose(f"{spoken(b.signal)} {border} {b.unit}".rstrip())


def opened(text: str) -> str:
    """The text with a capital first letter."""
    return text[:1].upper() + text[1:]


AT = re.compile(r"at (?P<by>.+) (?P<x>-?[\d.]+(?:e[+-]?\d+)?)")  # a place on a curve, as own_forms names it
PER_SECOND = re.compile(r"(\d) (rad|m) s$")
IN = re.compile(r"(?P<name>[^\[]+)\[(?P<where>.+)\]")  # in one recording, or at one knot
NOTHING = 1e-3  # of the widest place on a curve: a place nearer to zero is zero
ADD_UP = "what acts at a moment is the sum of all that hold there: {}"
KNOT = re.compile(r"\d (s|m)$")  # a place in time or along the road
STRETCH = re.compile(r"\d to \d+ (s|m)$")  # from one to another
RECORDINGS = 8  # in one row
NONE_SURE = "in no recording surely other than zero"
THERE_ALONE = "in that recording or near that moment alone"
HELD_AT_ZERO = "it cannot be less, and no more was seen"
ENDS = "by its form the curve ends there at zero"
Parameters = Mapping[str, Size]


@dataclass(frozen=True)
class Row:
    """A size in words."""

    name: str
    text: str


def rows(parameters: Parameters) -> list[Row]:
    """Name and text of every size, then how they add up where they are of several kinds."""
    fitted = {p.unit for p in parameters.values() if p.ci95 is not None}
    # what only chose a place on a grid is not told beside the size that was fitted about it
    shown = {n: p for n, p in parameters.items() if not (p.picked and p.unit in fitted)}
    sizes = [Row(_named(n, shown), _text(n, p, shown)) for n, p in shown.items()]
    kinds = _kinds(shown)
    return [*sizes, *([Row("together", ADD_UP.format(kinds))] if kinds else [])]


def short_rows(parameters: Parameters) -> list[Row]:
    """Rows for a terminal: without places on a curve and knots; what recordings have of their own in one."""
    few = {n: p for n, p in parameters.items() if not AT.fullmatch(n) and not IN.fullmatch(n)}
    return [*rows(few), *_by_recording(parameters)]


def _by_recording(parameters: Parameters) -> list[Row]:
    """Each size that recordings have of their own, where it is surely other than zero."""
    own: dict[str, list[str]] = {}
    for name, p in parameters.items():
        found = IN.fullmatch(name)
        if found is None or p.ci95 is None or KNOT.search(found["where"]):
            continue
        sure = own.setdefault(found["name"], [])
        if p.ci95[0] > 0.0 or p.ci95[1] < 0.0:
            sure.append(f"{measured(p.value, p.unit, None)} in {found['where']}")
    few = {n: [*s[:RECORDINGS], *(["others"] if len(s) > RECORDINGS else [])] for n, s in own.items()}
    return [
        Row(words(n), f"{', '.join(s)}; elsewhere none is sure" if s else NONE_SURE) for n, s in few.items()
    ]


def _named(name: str, shown: Parameters) -> str:
    """A size's name in words; recordings keep theirs."""
    curve, own = AT.fullmatch(name), IN.fullmatch(name)
    if curve:
        by, x = curve["by"], float(curve["x"])
        widest = max(abs(place) for place in _places(by, shown))
        x = 0.0 if abs(x) < NOTHING * widest else x
        return " ".join(filter(None, [f"at {words(by)} of {number(x)}", unit(by, {})]))
    if own:
        if STRETCH.search(own["where"]):
            return f"{words(own['name'])} at {own['where']}"
        near = KNOT.search(own["where"])
        return f"{words(own['name'])} {'near' if near else 'in'} {own['where']}{'' if near else ' alone'}"
    return SETTINGS.get(name, words(name)) if shown[name].picked else _plain(name)


def _plain(name: str) -> str:
    """A size's name in words, the unit at its end as it is written: 'force at 150 rad/s'."""
    return PER_SECOND.sub(r"\1 \2/s", words(name))


def _places(by: str, shown: Parameters) -> list[float]:
    found = [AT.fullmatch(name) for name in shown]
    return [float(f["x"]) for f in found if f and f["by"] == by]


def _text(name: str, p: Size, shown: Parameters) -> str:
    text = measured(p.value, p.unit, p.ci95)
    if p.picked:
        return f"about {text}, the best of a few that were tried"
    if p.value != 0.0 or p.ci95 is not None:
        return text
    curve = AT.fullmatch(name)
    places = _places(curve["by"], shown) if curve else []
    ends = curve is not None and float(curve["x"]) in (min(places), max(places))
    return f"{text}: {ENDS if ends else HELD_AT_ZERO}"


def _kinds(shown: Parameters) -> str:
    """The kinds of size of one unit, in words; empty where there is only one."""
    kinds: dict[str, str] = {}
    for name, p in shown.items():
        curve, own = AT.fullmatch(name), IN.fullmatch(name)
        if p.picked:
            continue
        if curve:
            kinds[f"at {curve['by']}"] = f"the curve over {words(curve['by'])}"
        elif own:
            kinds[f"[{own['name']}"] = f"{words(own['name'])} {THERE_ALONE}"
        else:
            kinds[name] = _plain(name)
    units = {p.unit for p in shown.values() if not p.picked}
    mixed = any(k.startswith(("at ", "[")) for k in kinds) and len(units) == 1
    return ", ".join(kinds.values()) if mixed and len(kinds) > 1 else ""


IN_PLACE = (  # the bars of the figure are another comparison, and have other numbers
    "These nats are of the one put in place of the other in the whole explanation. The figure of names below "
    "tries each alone."
)
UNDECIDED = f"So little decides nothing (below {Rules.least_gain:.0f} nats), and the probability is shared."
REFITTED = (
    "Beside all parameters refitted none of them gained what a name needs at a size it can have, so that the "
    "parameter is told."
)
LIMIT = (
    f"The fit alone would be surer than {{}}: {percent(1.0 - Rules.recognised)} of such names proved wrong, "
    "as a truck may hold a force unlike every form that was tried."
)


LIKENESS = "Only likeness to laws that were seen before speaks for"
NOT_NEAR = "put in its place, none does nearly as well at a size that it can have"


def apart(f: Finding) -> str:
    """What it is not distinguishable from and what decided; empty where there was no rival."""
    worse = {r.effect: r.worse_by_nats for r in f.rivals}
    group = f.cannot_be_told_from
    if not group:
        return " ".join(filter(None, [_beats_all(worse), *_at_the_limit(f)]))
    form = (
        f.nearest if f.nearest and f.effect != "unknown" else f.effect
    )  # what the others were put in place of
    rivals = [n for n in group if n != form]
    better = [n for n in rivals if worse.get(n, 0.0) < 0.0]
    others = [n for n in rivals if n not in better]
    said = [f"It is not distinguishable from {', '.join(spoken(n) for n in group)}."]
    if better:
        said.append(_does_better(form, better, worse))
        said += [REFITTED] if f.kind is Kind.PARAMETER else []
    alike = [n for n in others if n != "unknown" and worse.get(n) == 0.0]
    if alike:
        each = "it may do as well" if len(alike) == 1 else "each may do as well"
        said.append(f"Nothing speaks against {_listed(alike)}: {each}.")
    like = [n for n in others if n != "unknown" and n not in worse]
    if like:
        said.append(f"{LIKENESS} {_listed(like)}: {NOT_NEAR}.")
    if decided := [n for n in others if n not in alike + like]:
        first, *more = (_decided(form, n, worse.get(n)) for n in decided)
        said.append(f"What decided{' against the others' if better or alike or like else ''}: {first}.")
        said += [opened(f"{one}.") for one in more]
    in_place = [IN_PLACE] if any(worse.get(n) for n in rivals) else []
    return " ".join([*said, *in_place, *_at_the_limit(f)])


def _beats_all(worse: dict[str, float]) -> str:
    """That it is distinguishable from all others, and by how much from the next best."""
    nearest = min(worse, key=lambda n: worse[n], default=None)
    if nearest is None:
        return ""
    lead = f"{worse[nearest]:.0f} nats"
    return f"It is distinguishable from every other name; the next best, {spoken(nearest)}, is {lead} worse."


def _at_the_limit(f: Finding) -> list[str]:
    """Why a name is no surer than it is."""
    return [LIMIT.format(percent(f.probability))] if f.capped else []


def _does_better(name: str, better: Sequence[str], worse: dict[str, float]) -> str:
    """That the data speak for other names in its place: a low probability is then no slip."""
    listed = _joined([f"{spoken(n)} by {-worse[n]:.1f} nats" for n in better])
    said = opened(f"in place of {spoken(name)}, these fit the data better than it does: {listed}.")
    little = max(-worse[n] for n in better) < Rules.least_gain
    return f"{said} {UNDECIDED}" if little else said


def _listed(names: Sequence[str]) -> str:
    return _joined([spoken(n) for n in names])


def _joined(each: Sequence[str]) -> str:
    """In a row with 'and' before the last."""
    return " and ".join(filter(None, [", ".join(each[:-1]), each[-1]]))


def _decided(name: str, rival: str, worse: float | None) -> str:
    """How much of a lead comes from data and how much from what is plausible beforehand."""
    if rival == "unknown" and worse is None:
        return f"its signals, by which {spoken(name)} acts too; its form is another"
    if rival == "unknown" and worse == 0.0:
        return "nothing: a force without a name may do as well, and none of these drives tells"
    if rival == "unknown":
        return f"against a force without a name that comes and goes likewise the data, by {worse:.1f} nats"
    worse = worse or 0.0
    prior = math.log(LIBRARY[name].prior / LIBRARY[rival].prior) if {name, rival} <= set(LIBRARY) else 0.0
    data = worse - prior
    if data > abs(prior):
        return f"against {spoken(rival)} the data, by {data:.1f} nats"
    return f"against {spoken(rival)} prior plausibility ({prior:.1f} of {worse:.1f} nats), hardly the data"
