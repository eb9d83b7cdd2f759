"""The report's advice: what to drive and to record next."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from deeptruck_model.mismatch.mechanisms import LIBRARY
from deeptruck_model.mismatch.report import headline
from deeptruck_model.mismatch.report.page_words import condition, prose, spoken

if TYPE_CHECKING:
    from deeptruck_model.mismatch.find import Mismatch

LEAST_S = 20.0  # of driving under a condition, below which little can be seen there
TOURS = (
    "drive at least two separate tours of ten minutes each. Accelerate in steps of torque from 5 to 25 m/s, "
    "coast down from high speed, and brake in steps. Climb and descend, and come back on the same road"
)


def record_next(m: Mismatch) -> list[str]:
    """What to drive and to record, most useful first: each a sentence or a few."""
    kind = m.verdict["verdict"]
    if kind == "undetermined":
        return [f"To be able to say anything, {TOURS}.", *_to_test(m)]
    out = [text for f in m.findings if (text := _to_tell(f.data))]
    if any(f.cause is not None for f in m.findings) and not m.verdict["fit"].get("validated"):
        regimes = m.verdict["regimes"]
        where = condition(regimes[0]["where"]) if regimes else "the conditions in which it acts"
        out.append(f"To be able to validate the correction: more separate drives, held out, with {where}.")
    elif kind == "measurement_fault":
        out.append(f"To find out which sensor is at fault: {prose(m.findings[0].data['would_be_told_by'])}.")
    if hardly := _hardly_driven(m):
        out.append(f"Hardly driven, so effects there would not be seen: {', '.join(hardly)}.")
    return out + _to_test(m)


def _to_tell(finding: dict[str, Any]) -> str:
    """What tells a finding from those it is undecided with; empty where it is decided."""
    told = prose(finding["would_be_told_by"])
    if group := finding["cannot_be_told_from"]:
        names = headline.either(group, headline.RIVALS)
        return f"To tell {spoken(finding['effect'])} from {names}: {told}."
    return f"To learn more about the unknown force: {told}." if finding["effect"] == "unknown" else ""


def _to_test(m: Mismatch) -> list[str]:
    """Which signals to record for which names, that could not be tested without."""
    if m.explanation is None or m.evidence is None:
        return []
    untested: dict[str, list[str]] = {}
    for name, mechanism in LIBRARY.items():
        lacking = [n for n in mechanism.needs if not m.evidence.has(n)]
        if lacking:
            untested.setdefault(" and ".join(spoken(n) for n in lacking), []).append(name)
    return [_record(signal, names) for signal, names in untested.items()]


def _record(signal: str, names: Sequence[str]) -> str:
    return headline.fitting(
        lambda most, _: f"To be able to test {headline.either(names, 3 * most)}: record {signal}."
    )


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
