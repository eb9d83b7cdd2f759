"""What cannot be told apart and what would tell; when nothing is found, the smallest visible effect."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from deeptruck_model.mismatch.mechanisms import LIBRARY
from deeptruck_model.mismatch.posterior.causes import Explanation
from deeptruck_model.mismatch.posterior.intermittent import PER_WINDOW
from deeptruck_model.mismatch.posterior.penalties import PRACTICAL_FORCE, SLOW_PRICE, enough
from deeptruck_model.mismatch.posterior.rivals import (
    NEARLY_RIGHT,
    ORDINARY_ZERO,
    PARAMETER_PRACTICAL,
    SURE_OF_IT,
)
from deeptruck_model.mismatch.posterior.search import FREE, TEMPER, Model, Search
from deeptruck_model.mismatch.report.findings import TOLD_BY, Finding, in_sentences
from deeptruck_model.mismatch.residual.evidence import GRAVITY, Evidence

Array = NDArray[np.float64]

STEP, STEPS, HALVINGS = 1.5, 9, 3  # by which a hidden force is enlarged, how often, and made finer


def with_manoeuvres(found: Sequence[Finding]) -> list[Finding]:
    """Findings whose `would_be_told_by` names the manoeuvre that separates the nearest rival."""
    out = []
    for f in found:
        group = f.data["cannot_be_told_from"]
        if group:
            rival = LIBRARY[group[0]].told_by if group[0] in LIBRARY else TOLD_BY.get(group[0], "")
            told = in_sentences(f.data["would_be_told_by"], rival)
            f = Finding(f.data | {"would_be_told_by": told}, f.cause)
        out.append(f)
    return out


def smallest_visible(e: Evidence, x: Explanation) -> dict[str, Any]:
    """The relative error of each parameter, and the steady force (N), that would have been reported: each is
    hidden in the recordings and enlarged until it costs the simulator as given as much as a finding takes."""
    search = Search(e)
    hidden = _Hidden(search, search.model((), frozenset(), x.null.fit))
    out: dict[str, Any] = {}
    for p, column in e.sensitivity.items():
        size = hidden.least(column, PARAMETER_PRACTICAL, enough(search), NEARLY_RIGHT)
        out[p] = {"relative": round(min(size, 2 * FREE[p]), 4)}
    for force, name, nats in (
        (np.ones(len(e)), "all the time", enough(search)),
        (_a_part(e, 0.02), "2 % of the time", enough(search) + SLOW_PRICE + PER_WINDOW),
    ):
        size = hidden.least(force, PRACTICAL_FORCE, nats)
        out[f"steady force {name}"] = {"newton": round(size * e.mass, 1)}
    return out


@dataclass(frozen=True)
class _Hidden:
    """Forces hidden in recordings, and what they cost a model that does not have them."""

    search: Search
    model: Model

    def least(self, column: Array, size: float, nats: float, surely: float = 0.0) -> float:
        """The size of a force (n,), from `size` on, that costs `nats` and is surely above `surely`."""
        e = self.search.e
        acting = np.abs(column[e.valid])
        size = max(size, max(PRACTICAL_FORCE, e.own_error) / max(_rms(acting[acting > 0]), 1e-9))
        if self._seen(column, size, nats, surely):
            return size
        for _ in range(STEPS):
            size *= STEP
            if self._seen(column, size, nats, surely):
                break
        below = size / STEP
        for _ in range(HALVINGS):
            middle = 0.5 * (below + size)
            below, size = (below, middle) if self._seen(column, middle, nats, surely) else (middle, size)
        return size

    def _seen(self, column: Array, size: float, nats: float, surely: float) -> bool:
        cost = -self.search.gain_of_given(self.model, -size * column)
        sd = size * np.sqrt(TEMPER / max(2.0 * cost, 1e-9))
        return cost > nats and size - 1.96 * sd > surely and not self._as_a_zero(column, size, cost)

    def _as_a_zero(self, column: Array, size: float, cost: float) -> bool:
        """Whether an ordinary zero of the slope sensor would do nearly as well."""
        e = self.search.e
        zero = size * float(np.mean(column[e.valid]))
        rest = cost * (1.0 - zero**2 / max(size * _rms(column[e.valid]), 1e-9) ** 2)
        return abs(zero) < ORDINARY_ZERO * GRAVITY and rest < enough(self.search) and cost < SURE_OF_IT


def _rms(x: Array) -> float:
    return float(np.sqrt(np.mean(x**2))) if len(x) else 0.0


def _a_part(e: Evidence, share: float) -> Array:
    """One in the middle of what is valid for a share of it, else zero."""
    rows = np.flatnonzero(e.valid)
    first = int(len(rows) * (0.5 - share / 2))
    out = np.zeros(len(e))
    out[rows[first : first + max(1, round(share * len(rows)))]] = 1.0
    return out
