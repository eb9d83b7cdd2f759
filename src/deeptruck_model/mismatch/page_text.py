"""The report's words: the sentence that comes first, findings, and what was rejected."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from deeptruck_model.mismatch.drawing import colour, words
from deeptruck_model.mismatch.mechanisms import LIBRARY
from deeptruck_model.mismatch.search import POSSIBLE
from deeptruck_model.mismatch.validation_words import worse_than_parameters
from deeptruck_model.mismatch.worth_saying import ENOUGH

if TYPE_CHECKING:
    from deeptruck_model.mismatch.tool import Mismatch

HIDING_N = 600.0  # of a steady force: a third of what the tyres of a laden truck take
IN_PLACE = (  # the bars of the figure are another comparison, and have other numbers
    "These nats are lost where the one is put in place of the other in the whole explanation; the figure of "
    "names below tries each alone."
)
FINER = "; nearest name|; in a curve of its own|; it acts otherwise"  # not for a headline
IDENTIFIER = re.compile(r"\b[a-z][a-z0-9]*(?:_[a-z0-9]+)+\b")
SPOKEN = {  # names that are no words of their own once the underscores are gone
    "rolling_resistance_speed": "rolling resistance that grows with speed",
    "rolling_resistance_warmup": "rolling resistance of cold tyres",
    "torque_derate": "derated torque",
    "command_rate_limit": "limited rate of the commands",
    "load_slosh": "sloshing load",
    "speed_scale": "scale of the speed sensor",
    "unknown": "unknown force",
}


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


def prose(text: str) -> str:
    """A finding's own words without identifiers, and with signs as they are printed."""
    text = IDENTIFIER.sub(lambda found: spoken(found[0]), text)
    text = re.sub(r"\bsimulated\b(?! acceleration| on)", "simulated acceleration", text.replace("_", " "))
    text = re.sub(r"\b\d+(\.\d+)?e[+-]\d+\b", lambda found: number(float(found[0])), text)
    return text.replace("+-", "±").replace("^2", "²").replace("^3", "³")


def opened(text: str) -> str:
    """The text with a capital first letter."""
    return text[:1].upper() + text[1:]


def sentence(v: dict[str, Any]) -> str:
    """The verdict in one sentence for a truck engineer."""
    findings, kind = v["findings"], v["verdict"]
    if kind == "undetermined":
        reason = v["caveats"][-1] if v["caveats"] else "the recordings do not tell"
        return f"Nothing can be said yet: {prose(reason)}."
    if kind == "nothing_missing" or not findings:
        return f"{_nothing(v)}{_would_have_been_seen(v)}."
    main = max((f for f in findings if f["kind"] == kind), key=lambda f: f["share_of_explainable_error"])
    opening = {
        "missing_physics": "The simulator leaves something out",
        "parameter_error": "No physics is missing, but a parameter of the simulator is off",
        "measurement_fault": "A sensor is at fault, not the truck model",
    }[kind]
    if kind == "parameter_error" and any(f["kind"] == "missing_physics" for f in findings):
        opening = "A parameter of the simulator is off, and it leaves something out"
    elif kind == "parameter_error" and (alike := _physics(main["cannot_be_told_from"])):
        names = " or ".join(spoken(n) for n in alike[:3])
        opening = f"A parameter of the simulator is off, or {names}, which acts alike, is left out"
    others = len(findings) - 1
    more = f" (and {others} more finding{'s' if others > 1 else ''} below)" if others else ""
    says = re.split(FINER, prose(main["says"]))[0]
    return f"{opening}: {says}{more}{_improves(v)}."


def _physics(names: Sequence[str]) -> list[str]:
    """Those names that are missing physics and no parameter or sensor."""
    mechanisms = [n for n in names if n in LIBRARY and LIBRARY[n].kind == "missing_physics"]
    return [n for n in mechanisms if n not in POSSIBLE]


def _nothing(v: dict[str, Any]) -> str:
    """That nothing was found; where much could hide, no more than that."""
    if _visible_n(v) > HIDING_N:
        return "Nothing was found, but much could hide in what the simulator has learned imperfectly"
    return "Nothing is missing: the simulator agrees with these recordings"


def _visible_n(v: dict[str, Any]) -> float:
    """The smallest steady force that would have been seen, N; 0 where that is not known."""
    steady = v["data"].get("smallest_visible", {}).get("steady force all the time", {})
    return float(steady.get("newton") or 0.0)


def _would_have_been_seen(v: dict[str, Any]) -> str:
    seen = _visible_n(v)
    return f"; a steady force above {number(seen)} N would have been seen" if seen else ""


def _improves(v: dict[str, Any]) -> str:
    fit = v["fit"]
    if all(f["kind"] == "measurement_fault" for f in v["findings"]):
        return ""
    if "after" not in fit:
        return "; no held-out drive is long enough without a gap to prove it"
    if not fit.get("validated"):
        return "; no correction proved better on held-out recordings, so none may be applied"
    old, new, tuned = (fit[s]["speed_rmse"] for s in ("before", "after", "parameters_only"))
    laws = " and laws without a name" if fit.get("with_unnamed") else ""
    beside = f", where refitted parameters alone reach {number(tuned)}" if worse_than_parameters(fit) else ""
    return (
        f"; with {'it' if len(v['findings']) == 1 else 'them'}{laws} corrected, the speed error of "
        f"{number(fit['horizon_s'])} s free runs on held-out recordings falls from {number(old)} to "
        f"{number(new)} m/s{beside}"
    )


def findings(m: Mismatch) -> list[dict[str, Any]]:
    """What the page shows of each finding."""
    return [_finding(k, f.data) for k, f in enumerate(m.findings)]


def _finding(k: int, f: dict[str, Any]) -> dict[str, Any]:
    sizes = [
        {"name": re.sub(" s$", ", s", words(n)), "text": measured(p["value"], p["unit"], p["ci95"])}
        for n, p in f["parameters"].items()
        if p["value"] is not None and n != "held_out_r2"
    ]
    facts = {"probability": percent(f["probability"])}
    if f["share_of_explainable_error"] > 0:
        facts["explains"] = f"{percent(f['share_of_explainable_error'])} of the explainable error"
    if "held_out_r2" in f["parameters"]:
        r2 = max(f["parameters"]["held_out_r2"]["value"] or 0.0, 0.0)
        facts["laws predict"] = f"{percent(r2)} of the variance that names leave, on recordings not fitted to"
    if "formula_r2" in f:
        r2 = max(f["formula_r2"], 0.0)
        facts["the formula predicts"] = f"{percent(r2)} of the variance of these laws, on held-out recordings"
    return {
        "name": spoken(f["effect"]),
        "kind": words(f["kind"]),
        "colour": colour(k),
        "says": opened(prose(f["says"])),
        "sizes": sizes,
        "equation": f["equation"],
        "facts": facts,
        "depends_on": ", ".join(spoken(d) for d in f["depends_on"]),
        "apart": _apart(f),
        "to_be_sure": opened(prose(f["would_be_told_by"])),
    }


def _apart(f: dict[str, Any]) -> str:
    """What it cannot be told from and what decided; empty where there was no rival."""
    worse = {r["effect"]: r["worse_by_nats"] for r in f.get("rivals", [])}
    group = f["cannot_be_told_from"]
    if not group:
        nearest = min(worse, key=lambda n: worse[n], default=None)
        if nearest is None:
            return ""
        lead = f"{worse[nearest]:.0f} nats"
        return f"It is told from every other name; the next best, {spoken(nearest)}, is {lead} worse."
    decided = "; ".join(_decided(f["effect"], rival, worse.get(rival)) for rival in group)
    meant = f" {IN_PLACE}" if any(g in worse for g in group) else ""
    return f"It cannot be told from {', '.join(spoken(g) for g in group)}. What decided: {decided}.{meant}"


def _decided(name: str, rival: str, worse: float | None) -> str:
    """How much of a lead comes from data and how much from what is plausible beforehand."""
    if rival == "unknown" and worse is None:
        return f"its signals, by which {spoken(name)} acts too; its form is another"
    if rival == "unknown" and worse == 0.0:
        return "nothing: a force without a name may do as well, and none of these drives tells"
    if rival == "unknown":
        return f"against a force without a name that comes and goes likewise the data, by {worse:.1f} nats"
    prior, worse = 0.0, worse or 0.0
    if name in LIBRARY and rival in LIBRARY:
        prior = math.log(LIBRARY[name].prior / LIBRARY[rival].prior)
    data = worse - prior
    if data > abs(prior):
        return f"against {spoken(rival)} the data, by {data:.1f} nats"
    if prior > 0:
        return (
            f"against {spoken(rival)} prior plausibility ({prior:.1f} of {worse:.1f} nats), hardly the data"
        )
    return f"against {spoken(rival)} hardly anything ({worse:.1f} nats)"


def rejected_names(m: Mismatch) -> tuple[list[dict[str, str]], list[str], dict[str, list[str]]]:
    """Names that gained something and why they are not stated; names that gained nothing; and names that
    could not be tested, by the signal they lack.
    """
    if m.explanation is None or m.evidence is None:
        return [], [], {}
    stated = {c.effect for c in m.explanation.causes if c.shape is not None}
    nearest = next((c.nearest for c in m.explanation.causes if c.nearest), None)
    winner = next((spoken(s) for s in m.explanation.model.effects if s in stated), None)
    gained = []
    for name, gain in m.explanation.ranking:
        if name in stated or gain < 1.0:
            continue
        gained.append({"name": spoken(name), "gain": f"{gain:.1f}", "why": _why(name, gain, nearest, winner)})
    untested: dict[str, list[str]] = {}
    for name, mechanism in LIBRARY.items():
        lacking = [n for n in mechanism.needs if not m.evidence.has(n)]
        if lacking:
            untested.setdefault(" and ".join(spoken(n) for n in lacking), []).append(spoken(name))
    seen = stated | {n for n, g in m.explanation.ranking if g >= 1.0}
    tried = [n for n, x in LIBRARY.items() if n not in m.excluded and m.evidence.has(*x.needs)]
    nothing = [spoken(n) for n in tried if n not in seen]
    return gained, nothing, untested


def _why(name: str, gain: float, nearest: str | None, winner: str | None) -> str:
    """Why a name that gained some nats is not stated."""
    if name == nearest:
        return "explains too little of what a free model explains"
    if gain < ENOUGH:
        return f"too little evidence: {ENOUGH:.0f} nats are needed"
    if winner is not None:
        return f"{winner} explains the same better"
    return (
        f"behind {spoken(nearest)}, which explains too little itself" if nearest else "of no practical size"
    )
