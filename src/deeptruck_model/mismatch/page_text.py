"""The report's words: the sentence that comes first, findings, what was rejected, and what to record next."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from deeptruck_model.mismatch.drawing import colour, words
from deeptruck_model.mismatch.mechanisms import LIBRARY
from deeptruck_model.mismatch.worth_saying import ENOUGH

if TYPE_CHECKING:
    from deeptruck_model.mismatch.tool import Mismatch

FINER = "; nearest name|; in a curve of its own|; it acts otherwise"  # not for a headline
LEAST_S = 20.0  # of driving under a condition, below which little can be seen there
MANOEUVRES = (
    "drive at least two separate tours of ten minutes each: accelerate in steps of torque from 5 to 25 m/s, "
    "coast down from high speed, brake in steps, climb and descend, and come back on the same road"
)


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


def prose(text: str) -> str:
    """A finding's own words with signs as they are printed."""
    text = re.sub(r"\bsimulated\b(?! acceleration)", "simulated acceleration", text.replace("_", " "))
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
        return f"Nothing is missing: the simulator agrees with these recordings{_would_have_been_seen(v)}."
    main = max((f for f in findings if f["kind"] == kind), key=lambda f: f["share_of_explainable_error"])
    opening = {
        "missing_physics": "The simulator leaves something out",
        "parameter_error": "No physics is missing, but a parameter of the simulator is off",
        "measurement_fault": "A sensor is at fault, not the truck model",
    }[kind]
    if kind == "parameter_error" and any(f["kind"] == "missing_physics" for f in findings):
        opening = "A parameter of the simulator is off, and it leaves something out"
    others = len(findings) - 1
    more = f" (and {others} more finding{'s' if others > 1 else ''} below)" if others else ""
    says = re.split(FINER, prose(main["says"]))[0]
    return f"{opening}: {says}{more}{_improves(v)}."


def _would_have_been_seen(v: dict[str, Any]) -> str:
    steady = v["data"].get("smallest_visible", {}).get("steady force all the time", {})
    if "newton" not in steady:
        return ""
    return f"; a steady force above {number(steady['newton'])} N would have been seen"


def _improves(v: dict[str, Any]) -> str:
    fit = v["fit"]
    if all(f["kind"] == "measurement_fault" for f in v["findings"]):
        return ""
    if "after" not in fit:
        return "; no held-out drive is long enough to prove it"
    if not fit.get("validated"):
        return "; no correction proved better on held-out recordings, so none may be applied"
    old, new = fit["before"]["speed_rmse"], fit["after"]["speed_rmse"]
    return (
        f"; with it corrected, the speed error of {number(fit['horizon_s'])} s free runs on held-out "
        f"recordings falls from {number(old)} to {number(new)} m/s"
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
    if "formula_r2" in f:
        facts["predicted"] = f"{percent(max(f['formula_r2'], 0.0))} of its variance on held-out recordings"
    return {
        "name": words(f["effect"]),
        "kind": words(f["kind"]),
        "colour": colour(k),
        "says": opened(prose(f["says"])),
        "sizes": sizes,
        "equation": f["equation"],
        "facts": facts,
        "depends_on": ", ".join(words(d) for d in f["depends_on"]),
        "apart": _apart(f),
        "told_by": f["would_be_told_by"],
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
        return f"It is told from every other name; the next best, {words(nearest)}, is {lead} worse."
    decided = "; ".join(_decided(f["effect"], rival, worse.get(rival)) for rival in group)
    return f"It cannot be told from {', '.join(words(g) for g in group)}. What decided: {decided}."


def _decided(name: str, rival: str, worse: float | None) -> str:
    """How much of a lead comes from data and how much from what is plausible beforehand."""
    if rival == "unknown" and worse is None:
        return f"its signals, by which {words(name)} acts too; its form is another"
    if rival == "unknown":
        return f"against a force without a name that comes and goes likewise the data, by {worse:.1f} nats"
    prior, worse = 0.0, worse or 0.0
    if name in LIBRARY and rival in LIBRARY:
        prior = math.log(LIBRARY[name].prior / LIBRARY[rival].prior)
    data = worse - prior
    if data > abs(prior):
        return f"against {words(rival)} the data, by {data:.1f} nats"
    if prior > 0:
        return f"against {words(rival)} prior plausibility ({prior:.1f} of {worse:.1f} nats), hardly the data"
    return f"against {words(rival)} hardly anything ({worse:.1f} nats)"


def rejected_names(m: Mismatch) -> tuple[list[dict[str, str]], list[str], dict[str, list[str]]]:
    """Names that gained something and why they are not stated; names that gained nothing; and names that
    could not be tested, by the signal they lack.
    """
    if m.explanation is None or m.evidence is None:
        return [], [], {}
    stated = {c.effect for c in m.explanation.causes if c.shape is not None}
    nearest = next((c.nearest for c in m.explanation.causes if c.nearest), None)
    winner = next((words(s) for s in m.explanation.model.effects if s in stated), None)
    gained = []
    for name, gain in m.explanation.ranking:
        if name in stated or gain < 1.0:
            continue
        gained.append({"name": words(name), "gain": f"{gain:.1f}", "why": _why(name, gain, nearest, winner)})
    untested: dict[str, list[str]] = {}
    for name, mechanism in LIBRARY.items():
        lacking = [n for n in mechanism.needs if not m.evidence.has(n)]
        if lacking:
            untested.setdefault(" and ".join(words(n) for n in lacking), []).append(words(name))
    seen = stated | {n for n, g in m.explanation.ranking if g >= 1.0}
    nothing = [words(n) for n, x in LIBRARY.items() if n not in seen and m.evidence.has(*x.needs)]
    return gained, nothing, untested


def _why(name: str, gain: float, nearest: str | None, winner: str | None) -> str:
    """Why a name that gained some nats is not stated."""
    if name == nearest:
        return "explains too little of what a free model explains"
    if gain < ENOUGH:
        return f"too little evidence: {ENOUGH:.0f} nats are needed"
    if winner is not None:
        return f"{winner} explains the same better"
    return f"behind {words(nearest)}, which explains too little itself" if nearest else "of no practical size"


def record_next(m: Mismatch, untested: dict[str, list[str]]) -> list[str]:
    """What to drive and to record, most useful first."""
    out = []
    for f in m.findings:
        group = f.data["cannot_be_told_from"]
        if group:
            names = ", ".join(words(g) for g in group)
            out.append(f"To tell {words(f.data['effect'])} from {names}: {f.data['would_be_told_by']}.")
        elif f.data["effect"] == "unknown":
            out.append(f"To learn more about the unknown force: {prose(f.data['would_be_told_by'])}.")
    fit = m.verdict["fit"]
    if m.verdict["verdict"] == "undetermined":
        out.append(f"To be able to say anything: {MANOEUVRES}.")
    elif any(f.cause is not None for f in m.findings) and not fit.get("validated"):
        where = (
            m.verdict["regimes"][0]["where"] if m.verdict["regimes"] else "the conditions in which it acts"
        )
        out.append(
            f"To be able to validate the correction: more separate drives, held out, with {prose(where)}."
        )
    elif m.verdict["verdict"] == "measurement_fault":
        out.append(f"To find out which sensor is at fault: {m.findings[0].data['would_be_told_by']}.")
    hardly = _hardly_driven(m)
    if hardly and m.verdict["verdict"] != "undetermined":
        out.append(f"Hardly driven, so effects there would not be seen: {', '.join(hardly)}.")
    out += [f"To be able to test {', '.join(names)}: record {needs}." for needs, names in untested.items()]
    return out


def _hardly_driven(m: Mismatch) -> list[str]:
    def seconds(name: str, low: float, high: float) -> float:
        return sum(
            float(np.sum((p.recording.channels[name] > low) & (p.recording.channels[name] < high))) * p.dt
            for p in m.prepared
            if name in p.recording.channels
        )

    conditions = {
        "below 8 m/s": ("speed", 1.0, 8.0),
        "above 20 m/s": ("speed", 20.0, 90.0),
        "braking": ("brake_command", 1e-6, 1e9),
        "uphill above 2 %": ("grade", 0.02, 1.0),
        "downhill above 2 %": ("grade", -1.0, -0.02),
    }
    known = {name for p in m.prepared for name in p.recording.channels}
    return [
        text
        for text, (name, low, high) in conditions.items()
        if name in known and seconds(name, low, high) < LEAST_S
    ]
