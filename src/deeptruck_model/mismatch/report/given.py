"""The report's advice: what to drive and to record next."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from deeptruck_model.mismatch.data.prepared import HELD_OUT_SHARE, SAME_DRIVES, Prepared
from deeptruck_model.mismatch.finding import Finding
from deeptruck_model.mismatch.mechanisms import LIBRARY
from deeptruck_model.mismatch.report import names as named
from deeptruck_model.mismatch.report.wording import condition, counted, prose, spoken
from deeptruck_model.mismatch.result import Conclusion, Mismatch, Verdict
from deeptruck_model.recordings import Recording


def summary(m: Mismatch) -> str:
    """How many recordings were given, how long they are, and what of them judges."""
    hours = sum(len(p.recording) * p.dt for p in m.prepared) / 3600
    length = f"{hours:.1f} h" if hours >= 1 else f"{60 * hours:.0f} min"
    given = sum(not cut for cut in _cut_off(m.prepared))
    return f"{counted(given, 'recording')}, {length}{' together' if given > 1 else ''}{_held_out(m)}."


def _held_out(m: Mismatch) -> str:
    held = [s.held_out for s in m.evidence.stretches] if m.evidence is not None else []
    cut = _cut_off(m.prepared)
    ends = sum(h and c for h, c in zip(held, cut, strict=False))
    if not any(held):
        return ""
    if not ends:
        return f", {sum(held)} of them held out for judging"
    given = sum(not c for c in cut)
    whose = "it" if given == 1 else "each" if ends == given else f"{ends} of them"
    return f", the last {100 * HELD_OUT_SHARE:.0f} % of {whose} held out for judging"


def _cut_off(prepared: Sequence[Prepared]) -> list[bool]:
    """Which of them go on where the one before ends: the later part of one that was cut in two."""
    out = [False]
    for before, after in pairwise(prepared):
        a, b = before.recording, after.recording
        on = abs(a.start_s + len(a) * a.dt - b.start_s) < 0.5 * a.dt
        out.append(a.name == b.name and on)
    return out[: len(prepared)]


def as_given(prepared: Sequence[Prepared]) -> list[Recording]:
    """The recordings with those that were cut in two in one again."""
    out: list[Recording] = []
    for p, cut in zip(prepared, _cut_off(prepared), strict=True):
        if cut:
            whole = {n: np.concatenate([out[-1].channels[n], x]) for n, x in p.recording.channels.items()}
            out[-1] = replace(out[-1], channels=whole)
        else:
            out.append(p.recording)
    return out


def caveats(verdict: Verdict) -> list[str]:
    """What limits what is claimed; where nothing is, not whom the claim is about."""
    claimed = verdict.kind is not Conclusion.UNDETERMINED
    return [c for c in verdict.caveats if claimed or c != SAME_DRIVES]


LEAST_S = 20.0  # of driving under a condition, below which little can be seen there
TOURS = (
    "drive at least two separate tours of ten minutes each. Accelerate in steps of torque through all its "
    "speeds, coast down from the highest, and brake in steps. Climb, descend, and come back on the same road"
)


ALIKE = (
    "What was found belongs to a time, a place or a drive, as a load does: tell the simulator drive by "
    "drive, or compare only drives that are alike in it."
)


def record_next(m: Mismatch) -> list[str]:
    """What to drive and to record, most useful first: each a sentence or a few."""
    v = m.result
    if v.kind is Conclusion.UNDETERMINED:
        told = {s.would_be_told_by: s.effect for s in v.suspicions}  # each manoeuvre once
        doubts = [f"To tell whether it is {spoken(name)}: {prose(by)}." for by, name in told.items()]
        return doubts or [f"To be able to say more, {TOURS}."]
    out = [text for f in v.findings if (text := _to_tell(f))]
    if of_these_drives(v.findings) and not v.validated:
        out.append(ALIKE)
    elif any(f.cause is not None for f in v.findings) and not v.validated:
        simple = next((r for r in v.regimes if len(r.bounds) == 1), None)
        where = condition(simple) if simple is not None else "the conditions in which it acts"
        out.append(f"To be able to validate the correction: more separate drives, held out, with {where}.")
    elif v.kind is Conclusion.SENSOR:
        out.append(f"To find out which sensor is at fault: {prose(v.findings[0].would_be_told_by)}.")
    if hardly := _hardly_driven(m):
        out.append(f"Hardly driven, so effects there would not be seen: {', '.join(hardly)}.")
    return out


def of_these_drives(findings: Sequence[Finding]) -> bool:
    """Whether all forces that were found belong to a time, a place or a recording."""
    terms = [f.cause.term for f in findings if f.cause is not None]
    return bool(terms) and all(t is not None and not t.variant.is_a_law for t in terms)


def _to_tell(finding: Finding) -> str:
    """What tells a finding from those it is undecided with; empty where it is decided."""
    told = prose(finding.would_be_told_by)
    if group := finding.cannot_be_told_from:
        names = named.either(group, named.RIVALS)
        return f"To tell {spoken(finding.effect)} from {names}: {told}."
    return f"To learn more about the unknown force: {told}." if finding.effect == "unknown" else ""


def untested(m: Mismatch) -> list[str]:
    """Which names could not be tested, for lack of which signals."""
    if m.explanation is None or m.evidence is None:
        return []
    lacking_for: dict[str, list[str]] = {}
    for name, mechanism in LIBRARY.items():
        lacking = [n for n in mechanism.needs if not m.evidence.has(n)]
        if lacking:
            lacking_for.setdefault(" and ".join(spoken(n) for n in lacking), []).append(name)
    return [_not_tested(signal, names) for signal, names in lacking_for.items()]


def _not_tested(signal: str, names: Sequence[str]) -> str:
    return named.fitting(lambda most, _: f"Not tested without {signal}: {named.either(names, 3 * most)}.")


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
