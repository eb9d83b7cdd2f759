"""The report's words: findings, and what was rejected."""

from __future__ import annotations

from dataclasses import dataclass

from deeptruck_model.mismatch.finding import Finding
from deeptruck_model.mismatch.mechanisms import LIBRARY
from deeptruck_model.mismatch.report import headline, names, wording
from deeptruck_model.mismatch.report.drawing import colour, words
from deeptruck_model.mismatch.report.wording import apart, opened, percent, prose, spoken
from deeptruck_model.mismatch.result import Mismatch, Verdict


@dataclass(frozen=True)
class Told:
    """A finding in the words of the page; `facts` by what each is called."""

    name: str
    kind: str
    colour: str
    says: str
    sizes: list[wording.Row]
    equation: str
    facts: dict[str, str]
    depends_on: str
    apart: str
    to_be_sure: str


@dataclass(frozen=True)
class Unstated:
    """A name that gained some nats, and why it is not stated."""

    name: str
    gain: str
    why: str


def findings(m: Mismatch) -> list[Told]:
    """What the page shows of each finding."""
    return [told(k, f) for k, f in enumerate(m.result.findings)]


def told(k: int, f: Finding) -> Told:
    """A finding, the k-th, in words."""
    return Told(
        name=opened(names.group(headline.name(f))),
        kind=words(f.kind),
        colour=colour(k),
        says=f"{opened(prose(f.says))}.",
        sizes=wording.rows(f.parameters),
        equation=f.equation,
        facts=_facts(f),
        depends_on=", ".join(spoken(d) for d in f.depends_on),
        apart=apart(f),
        to_be_sure=f"{opened(prose(f.would_be_told_by))}.",
    )


def _facts(f: Finding) -> dict[str, str]:
    of = f", of {spoken(f.effect)}" if f.cannot_be_told_from else ""
    facts = {"probability": f"{percent(f.probability)}{of}"}
    if f.share_of_explainable_error > 0:
        facts["explains"] = f"{percent(f.share_of_explainable_error)} of the explainable error"
    if f.laws_r2 is not None:
        r2 = percent(_at_least_zero(f.laws_r2))
        facts["laws predict"] = f"{r2} of the variance that names leave, on recordings not fitted to"
    if f.formula_r2 is not None:
        r2 = percent(_at_least_zero(f.formula_r2))
        facts["the formula predicts"] = f"{r2} of the variance of these laws, on held-out recordings"
    return facts


def _at_least_zero(r2: float) -> float:
    return r2 if r2 > 0.0 else 0.0  # also where it is NaN


def suspicions(verdict: Verdict) -> list[Unstated]:
    """What was found at first and is no finding; `why` says what would tell."""
    return [
        Unstated(spoken(s.effect), f"{s.evidence_nats:.1f}", opened(s.would_be_told_by))
        for s in verdict.suspicions
    ]


def rejected_names(m: Mismatch) -> tuple[list[Unstated], list[str]]:
    """Names that gained something and why they are not stated; and names that gained nothing. Names of a
    group, and those that are suspected, are in neither: these are told where they stand."""
    if m.explanation is None or m.evidence is None:
        return [], []
    causes = m.explanation.causes
    stated = {c.effect for c in causes}  # a parameter has the name of its effect
    stated |= {c.acts_as for c in causes if c.effect != "unknown"}
    told = stated | {n for c in causes for n in c.not_told_from} | {s.effect for s in m.result.suspicions}
    nearest = next((c.nearest for c in causes if c.nearest and c.effect == "unknown"), None)
    winner = next((spoken(s) for s in m.explanation.model.effects if s in stated), None)
    gained = []
    for name, gain in sorted(m.explanation.ranking, key=lambda named: -named[1]):
        if name in told or gain < 1.0:
            continue
        why = _why(name, gain, nearest, winner, m.explanation.model.rules.least_gain)
        gained.append(Unstated(spoken(name), f"{gain:.1f}", why))
    seen = told | {n for n, g in m.explanation.ranking if g >= 1.0}
    tried = [n for n, x in LIBRARY.items() if n not in m.excluded and m.evidence.has(*x.needs)]
    nothing = [spoken(n) for n in tried if n not in seen]
    return gained, nothing


def _why(name: str, gain: float, nearest: str | None, winner: str | None, least: float) -> str:
    """Why a name that gained some nats is not stated."""
    if name == nearest:
        return "explains too little of what a free model explains"
    if gain < least:
        return f"too little evidence: {least:.0f} nats are needed"
    if winner is not None:
        return f"{winner} explains the same better"
    return (
        f"behind {spoken(nearest)}, which explains too little itself" if nearest else "of no practical size"
    )
