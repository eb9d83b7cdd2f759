"""The report's words: the sentence that comes first, findings, and what was rejected."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from deeptruck_model.mismatch import size_rows
from deeptruck_model.mismatch.drawing import colour, words
from deeptruck_model.mismatch.mechanisms import LIBRARY
from deeptruck_model.mismatch.page_words import number, opened, percent, prose, spoken
from deeptruck_model.mismatch.search import POSSIBLE
from deeptruck_model.mismatch.told_apart import apart
from deeptruck_model.mismatch.validation_words import (
    others_drive_much_better,
    parameters_alone,
    parameters_may_do_as_well,
)
from deeptruck_model.mismatch.worth_saying import ENOUGH

if TYPE_CHECKING:
    from deeptruck_model.mismatch.tool import Mismatch

HIDING_N = 600.0  # of a steady force: a third of what the tyres of a laden truck take
FINER = "; nearest name|; in a curve of its own|; it acts otherwise"  # not for a headline


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
        which = "which acts alike, is" if len(alike) == 1 else "which act alike, are"
        opening = f"A parameter of the simulator is off, or {names}, {which} left out"
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
    if others_drive_much_better(v["fit"]):
        return (
            "No physics is missing that has shown itself, but the simulator is off: with other parameters it "
            "drives the held-out recordings much better, though none of them is surely wrong"
        )
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
    alone = f", where refitted parameters alone reach {number(tuned)}"
    beside = alone if parameters_may_do_as_well(fit) else ""
    what = "it" if len(v["findings"]) == 1 else "them"
    with_this = "its parameters alone refitted" if parameters_alone(fit) else f"{what}{laws} corrected"
    return (
        f"; with {with_this}, the speed error of "
        f"{number(fit['horizon_s'])} s free runs on held-out recordings falls from {number(old)} to "
        f"{number(new)} m/s{beside}"
    )


def findings(m: Mismatch) -> list[dict[str, Any]]:
    """What the page shows of each finding."""
    return [_finding(k, f.data) for k, f in enumerate(m.findings)]


def _finding(k: int, f: dict[str, Any]) -> dict[str, Any]:
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
        "sizes": size_rows.rows(f["parameters"]),
        "equation": f["equation"],
        "facts": facts,
        "depends_on": ", ".join(spoken(d) for d in f["depends_on"]),
        "apart": apart(f),
        "to_be_sure": opened(prose(f["would_be_told_by"])),
    }


def rejected_names(m: Mismatch) -> tuple[list[dict[str, str]], list[str], dict[str, list[str]]]:
    """Names that gained something and why they are not stated; names that gained nothing; and names that
    could not be tested, by the signal they lack.
    """
    if m.explanation is None or m.evidence is None:
        return [], [], {}
    stated = {c.effect for c in m.explanation.causes}  # a parameter has the name of its effect
    nearest = next((c.nearest for c in m.explanation.causes if c.nearest), None)
    winner = next((spoken(s) for s in m.explanation.model.effects if s in stated), None)
    gained = []
    for name, gain in sorted(m.explanation.ranking, key=lambda named: -named[1]):
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
