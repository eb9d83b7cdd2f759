"""The report's advice: what to drive and to record next."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from deeptruck_model.mismatch.page_words import condition, prose, spoken

if TYPE_CHECKING:
    from deeptruck_model.mismatch.tool import Mismatch

LEAST_S = 20.0  # of driving under a condition, below which little can be seen there
MANOEUVRES = (
    "drive at least two separate tours of ten minutes each: accelerate in steps of torque from 5 to 25 m/s, "
    "coast down from high speed, brake in steps, climb and descend, and come back on the same road"
)


def record_next(m: Mismatch, untested: dict[str, list[str]]) -> list[str]:
    """What to drive and to record, most useful first."""
    out = []
    for f in m.findings:
        group = f.data["cannot_be_told_from"]
        if group:
            names = ", ".join(spoken(g) for g in group)
            out.append(
                f"To tell {spoken(f.data['effect'])} from {names}: {prose(f.data['would_be_told_by'])}."
            )
        elif f.data["effect"] == "unknown":
            out.append(f"To learn more about the unknown force: {prose(f.data['would_be_told_by'])}.")
    fit = m.verdict["fit"]
    if m.verdict["verdict"] == "undetermined":
        out.append(f"To be able to say anything: {MANOEUVRES}.")
    elif any(f.cause is not None for f in m.findings) and not fit.get("validated"):
        regimes = m.verdict["regimes"]
        where = condition(regimes[0]["where"]) if regimes else "the conditions in which it acts"
        out.append(f"To be able to validate the correction: more separate drives, held out, with {where}.")
    elif m.verdict["verdict"] == "measurement_fault":
        out.append(f"To find out which sensor is at fault: {prose(m.findings[0].data['would_be_told_by'])}.")
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
