"""What the terminal and the page begin with, as sentences of one verdict."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from deeptruck_model.mismatch.report.wording import ROOT, opened, percent, spoken
from deeptruck_model.mismatch.result import Conclusion, Finding, Kind, Verdict
from deeptruck_model.mismatch.tree import Node

HEADLINES = {
    Conclusion.NOTHING: "Nothing that matters is missing",
    Conclusion.UNDETERMINED: "Undetermined: no cause is sure",
}
LARGE = 0.05  # of the budget: a part that is worth a word


def headline(v: Verdict) -> str:
    """At most eight words."""
    if not v.findings:
        return HEADLINES.get(v.kind, HEADLINES[Conclusion.UNDETERMINED])
    first = max(v.findings, key=lambda f: f.share_of_explainable_error)
    name = spoken(first.effect if first.stated == ROOT else first.stated)
    if first.kind is Kind.SENSOR:
        return opened(f"{name}: a fault of measurement")
    if first.kind is Kind.PARAMETER:
        return opened(f"{name} of the simulator is wrong")
    return opened(f"{name} is missing" if first.stated != ROOT else f"{name} is most probable")


def what(v: Verdict) -> Iterator[str]:
    """What is off, and by how much."""
    b = v.budget
    if b is not None and b.parts:
        large = [f"{spoken(p.part)} {percent(p.share)}" for p in b.parts if p.share >= LARGE]
        yield (
            f"Along the fitted drives the simulator is off by {b.speed_rmse:.2g} m/s after up to "
            f"{b.horizon_s:.0f} s. Of the square of that: {', '.join(large)}."
        )
    for w in v.witnesses[:3]:
        share, part = percent(w.share), spoken(w.part)
        yield f"The channel {w.channel} explains {share} of what is {part}, on drives left out."


def how_sure(v: Verdict) -> Iterator[str]:
    """Each finding with its probabilities."""
    for f in v.findings:
        yield sure(f)
    if not v.findings and v.tree and v.kind is Conclusion.UNDETERMINED:
        yield unsure(v.tree)


def unsure(tree: Sequence[Node]) -> str:
    """The most probable families, none of which is stated."""
    top = [n for n in tree if n.parent == ROOT][:3]
    if len(top) == 1:
        return "No mechanism was detected, and these data do not identify what the simulator is off by."
    split = ", ".join(f"{spoken(n.node)} {percent(n.probability)}" for n in top)
    return f"No part of the truck is at 90 %: {split}."


def sure(f: Finding) -> str:
    """The stated node and the split below it."""
    if f.kind is Kind.SENSOR or f.family == f.effect:
        return f"{opened(spoken(f.effect))}: {f.says}."
    split = f"{spoken(f.effect)} {percent(f.probability)}"
    if f.cannot_be_told_from:
        split += f", else {', '.join(map(spoken, f.cannot_be_told_from))}"
    return f"{opened(spoken(f.family))}, {percent(f.family_probability)}: {split}."


def not_recorded(v: Verdict) -> Iterator[str]:
    """What was not recorded, what that hides, and the signal to record."""
    for m in v.not_recorded:
        found = (
            f" It was found to act in {percent(m.share_of_time)} of the time; these rows are not compared."
            if m.share_of_time
            else ""
        )
        yield f"{opened(m.input)} was not recorded. {m.hides}{found} Record: {m.signal.replace('`', '')}."


def what_to_do(v: Verdict) -> Iterator[str]:
    """The next step."""
    apply = v.advice.get("apply")
    if v.validated and v.fit is not None and v.fit.errors is not None:
        yield f"Apply the correction: {apply.reason if apply else ''}."
    elif v.kind is Conclusion.NOTHING:
        yield "Use the simulator as it is."
    manoeuvres = dict.fromkeys(
        f.would_be_told_by for f in v.findings if f.would_be_told_by and f.cannot_be_told_from
    )
    for manoeuvre in list(manoeuvres)[:2]:
        yield f"To separate the names: {manoeuvre}."
    for m in v.not_recorded[:2]:
        yield f"Record {m.input}: {m.signal.replace('`', '')}."


def lines(v: Verdict) -> list[str]:
    """All of it, for the terminal."""
    return [headline(v) + ".", *not_recorded(v), *what(v), *how_sure(v), *what_to_do(v)]
