"""The report's words: findings, and what was rejected."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from deeptruck_model.mismatch.mechanisms import LIBRARY
from deeptruck_model.mismatch.report import headline, wording
from deeptruck_model.mismatch.report.drawing import colour, words
from deeptruck_model.mismatch.report.wording import apart, opened, percent, prose, spoken
from deeptruck_model.mismatch.rules import Rules

if TYPE_CHECKING:
    from deeptruck_model.mismatch.find import Mismatch


def findings(m: Mismatch) -> list[dict[str, Any]]:
    """What the page shows of each finding."""
    return [_finding(k, f.data) for k, f in enumerate(m.findings)]


def _finding(k: int, f: dict[str, Any]) -> dict[str, Any]:
    probability = percent(f["probability"])
    if f["cannot_be_told_from"]:
        probability = f"{probability}, of {spoken(f['effect'])}"
    facts = {"probability": probability}
    if f["share_of_explainable_error"] > 0:
        facts["explains"] = f"{percent(f['share_of_explainable_error'])} of the explainable error"
    if "held_out_r2" in f["parameters"]:
        r2 = max(f["parameters"]["held_out_r2"]["value"] or 0.0, 0.0)
        facts["laws predict"] = f"{percent(r2)} of the variance that names leave, on recordings not fitted to"
    if "formula_r2" in f:
        r2 = max(f["formula_r2"], 0.0)
        facts["the formula predicts"] = f"{percent(r2)} of the variance of these laws, on held-out recordings"
    return {
        "name": opened(headline.group(headline.name(f))),
        "kind": words(f["kind"]),
        "colour": colour(k),
        "says": f"{opened(prose(f['says']))}.",
        "sizes": wording.rows(f["parameters"]),
        "equation": f["equation"],
        "facts": facts,
        "depends_on": ", ".join(spoken(d) for d in f["depends_on"]),
        "apart": apart(f),
        "to_be_sure": f"{opened(prose(f['would_be_told_by']))}.",
    }


def rejected_names(m: Mismatch) -> tuple[list[dict[str, str]], list[str]]:
    """Names that gained something and why they are not stated; and names that gained nothing."""
    if m.explanation is None or m.evidence is None:
        return [], []
    stated = {c.effect for c in m.explanation.causes}  # a parameter has the name of its effect
    nearest = next((c.nearest for c in m.explanation.causes if c.nearest), None)
    winner = next((spoken(s) for s in m.explanation.model.effects if s in stated), None)
    gained = []
    for name, gain in sorted(m.explanation.ranking, key=lambda named: -named[1]):
        if name in stated or gain < 1.0:
            continue
        gained.append({"name": spoken(name), "gain": f"{gain:.1f}", "why": _why(name, gain, nearest, winner)})
    seen = stated | {n for n, g in m.explanation.ranking if g >= 1.0}
    tried = [n for n, x in LIBRARY.items() if n not in m.excluded and m.evidence.has(*x.needs)]
    nothing = [spoken(n) for n in tried if n not in seen]
    return gained, nothing


def _why(name: str, gain: float, nearest: str | None, winner: str | None) -> str:
    """Why a name that gained some nats is not stated."""
    if name == nearest:
        return "explains too little of what a free model explains"
    if gain < Rules.least_gain:
        return f"too little evidence: {Rules.least_gain:.0f} nats are needed"
    if winner is not None:
        return f"{winner} explains the same better"
    return (
        f"behind {spoken(nearest)}, which explains too little itself" if nearest else "of no practical size"
    )
