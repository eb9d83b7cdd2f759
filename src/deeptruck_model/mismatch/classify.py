"""Probabilities of names by the evidence of every name's kernel. No later fit changes this posterior."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from deeptruck_model.mismatch.posterior.effect_classifier import effect_classifier
from deeptruck_model.mismatch.posterior.kernel_evidence import KernelEvidence
from deeptruck_model.mismatch.posterior.kernels import NOTHING
from deeptruck_model.mismatch.posterior.regression import Regression
from deeptruck_model.mismatch.rules import Rules
from deeptruck_model.mismatch.tree import ROOT, UNKNOWN, Tree

Array = NDArray[np.float64]

LEAST_RATIO = 0.5  # of driving: in less than half as much, a discrepancy counts as in half


@dataclass(frozen=True)
class Named:
    """One thing that was named beside those before it: the `name`, the tree (whose probabilities count that
    those before may be wrong), the gain (nats) of the best kernel with parameters `held` and `free`, and the
    posterior mean of the name's force (n,), m/s^2. Only where it is `accepted` it may be a finding.
    """

    name: str
    tree: Tree
    held: float
    free: float
    force: Array
    accepted: bool = True


@dataclass(frozen=True)
class Names:
    """All that was named, the most evident first; `gain_free` is what the best kernel gains with parameters
    free, nats, and `threshold` the gain below which nothing is detected."""

    found: tuple[Named, ...]
    gain_free: float
    threshold: float

    @property
    def detected(self) -> bool:
        return self.gain_free > self.threshold


def classify(search: Regression, rules: Rules) -> Names:
    """Names one after the other, each beside the kernels of those before it, until nothing more is more
    probable than any name."""
    evidence = KernelEvidence(search, search.background(()))
    y = search.series.y
    threshold = _threshold(search, rules)
    found: list[Named] = []
    given: list[str] = []
    gain_free = 0.0
    p_right = 1.0  # joint probability of the names given
    while len(found) < rules.most_findings:
        seen = evidence.of(y[:, None], given)
        held, free = float(seen.held.nats.max()), float(seen.free.nats.max())
        gain_free = gain_free if found else free
        if max(held, free) <= threshold:
            break
        by = effect_classifier()
        p = by.flattened(seen)[0]
        if found and p[by.names.index(NOTHING)] > rules.nothing_more:
            break
        names = {n: float(x) for n, x in zip(by.names, p, strict=True) if n != NOTHING and n not in given}
        total = sum(names.values())
        tree = Tree({n: x / total for n, x in names.items()})
        probable = next(iter(tree.families.values())) >= rules.named
        best = tree.first if probable else UNKNOWN
        whole = tree.given(p_right)
        stated = whole.stated(rules.stated) != ROOT  # a learned simulator's discrepancy resembles many names
        accepted = stated or search.e.known_physics
        found.append(Named(best, whole, held, free, evidence.force(y, best, given), accepted))
        if best == UNKNOWN:
            break
        given.append(best)
        p_right *= tree.names[best]
    return Names(tuple(found), gain_free, threshold)


def _threshold(search: Regression, rules: Rules) -> float:
    """The gain below which nothing is detected: also what the best kernel gains, in as much driving, on the
    recordings that a learned simulator keeps."""
    if search.own is None:
        return rules.least_gain
    own = search.own
    seen = KernelEvidence(own, own.background(())).of(own.series.y[:, None])
    ratio = max(float(search.e.valid.sum()) / max(float(own.e.valid.sum()), 1.0), LEAST_RATIO)
    return max(rules.least_gain, rules.discrepancy * ratio * float(seen.free.nats.max()))
