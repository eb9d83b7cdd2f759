"""What cannot be told apart and what would tell; when nothing is found, the smallest visible effect."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from deeptruck_model.mismatch.causes import Explanation
from deeptruck_model.mismatch.evidence import Evidence
from deeptruck_model.mismatch.findings import TOLD_BY, Finding
from deeptruck_model.mismatch.mechanisms import LIBRARY
from deeptruck_model.mismatch.search import FREE
from deeptruck_model.mismatch.worth_saying import ENOUGH, PRACTICAL_FORCE


def with_manoeuvres(found: Sequence[Finding]) -> list[Finding]:
    """Findings whose `would_be_told_by` names the manoeuvre that separates the nearest rival."""
    out = []
    for f in found:
        group = f.data["cannot_be_told_from"]
        if group:
            rival = LIBRARY[group[0]].told_by if group[0] in LIBRARY else TOLD_BY.get(group[0], "")
            told = "; and ".join(filter(None, (f.data["would_be_told_by"], rival)))
            f = Finding(f.data | {"would_be_told_by": told}, f.cause)
        out.append(f)
    return out


def smallest_visible(e: Evidence, x: Explanation) -> dict[str, Any]:
    """The relative error of each parameter, and the steady force (N), that would just have been reported."""
    out: dict[str, Any] = {}
    free = x.parameters_only
    for p in e.sensitivity:
        sd = free.change_sd(p)
        out[p] = {"relative": round(min(sd * np.sqrt(2 * ENOUGH), FREE[p] * 2), 4)}
    rows = max(int(e.valid.sum()), 1)
    sigma = x.null.fit.sigma / max(1.0 - float(x.null.fit.ar.sum()), 0.05)
    for share, name in ((1.0, "all the time"), (0.02, "2 % of the time")):
        force = max(sigma * np.sqrt(2 * ENOUGH / (rows * share)), PRACTICAL_FORCE, e.own_error) * e.mass
        out[f"steady force {name}"] = {"newton": round(float(force), 1)}
    return out
