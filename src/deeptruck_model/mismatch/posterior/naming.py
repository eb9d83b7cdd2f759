"""Each finding among all names, by what its fingerprint is like."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from deeptruck_model.mismatch.posterior.causes import Cause, Explanation
from deeptruck_model.mismatch.posterior.fingerprint import KernelEvidence
from deeptruck_model.mismatch.posterior.recogniser import recogniser
from deeptruck_model.mismatch.posterior.search import Search

Array = NDArray[np.float64]


def recognised(search: Search, found: Explanation) -> Explanation:
    """The explanation, each finding of missing physics with the probabilities of names that the recogniser
    gives it beside the others.

    Beside a learned simulator there are none: its model discrepancy is like any name. Nor for what acts in
    windows alone, or is slow: kernels are of what acts throughout.
    """
    if search.e.model_discrepancy > 0.0 or not any(map(_has_a_likeness, found.causes)):
        return found
    by = KernelEvidence(search, found.model)
    return replace(found, causes=tuple(_recognised(search, by, c, found.causes) for c in found.causes))


def _has_a_likeness(c: Cause) -> bool:
    windowed = c.term is not None and c.term.variant.acts_in_windows
    return c.kind == "missing_physics" and c.needed is None and not windowed


def _recognised(search: Search, by: KernelEvidence, c: Cause, causes: tuple[Cause, ...]) -> Cause:
    if not _has_a_likeness(c):
        return c
    others = [o.effect for o in causes if o is not c and o.effect != c.effect]
    seen = by.of(search.series.y[:, None], others)
    told = recogniser()
    log_p = np.log(np.maximum(told.probabilities(seen)[0], 1e-12))
    log_p += np.array([by.reported(c.force, name) for name in told.names]) / seen.unit[0]
    p = np.exp(log_p - log_p.max())
    likeness = zip(told.names, (p / p.sum()).tolist(), strict=True)
    return replace(c, likeness=tuple((name, x) for name, x in likeness if name not in others))
