"""What the page says of the recordings as they were given, whatever they were cut into."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from deeptruck_model.mismatch.data.inputs import HELD_OUT_SHARE, SAME_DRIVES
from deeptruck_model.mismatch.report.page_words import counted
from deeptruck_model.recordings import Recording

if TYPE_CHECKING:
    from deeptruck_model.mismatch.data.prepared import Prepared
    from deeptruck_model.mismatch.find import Mismatch


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


def caveats(verdict: dict[str, Any]) -> list[str]:
    """What limits what is claimed; where nothing is, not whom the claim is about."""
    claimed = verdict["verdict"] != "undetermined"
    return [c for c in verdict["caveats"] if claimed or c != SAME_DRIVES]
