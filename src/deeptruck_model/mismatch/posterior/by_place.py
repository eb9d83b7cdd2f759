"""Stretches of road that are off whenever a drive comes by.

A window in time needs two ends in each pass. A stretch has two for all passes, and other drives show it.
"""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from deeptruck_model.mismatch.mechanisms import CandidateTerm, candidate_term
from deeptruck_model.mismatch.mechanisms.road import BOTH
from deeptruck_model.mismatch.mechanisms.variants import Along, Places, Span, Sum, Variant, Windowed
from deeptruck_model.mismatch.posterior.penalties import enough
from deeptruck_model.mismatch.posterior.search import Model, Search
from deeptruck_model.mismatch.posterior.windows import ENDS, LARGEST_LOG, steady, steps, within
from deeptruck_model.mismatch.residual.evidence import Evidence

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

BIN_M, MOST_BINS = 10.0, 2000  # wider where the road is long
TINY = 1e-12  # of a size that is held at zero
MOST = 16  # stretches, those that stand out most
MOSTLY = 0.5  # of the passes over a stretch, of which more must be off the same way


def candidates(search: Search, base: Model, spans: list[Span]) -> list[Model]:
    """The road's mechanisms as if they acted along stretches of it alone, added to `base` and fitted; none
    where none stands out. In drives whose place nobody knows they act in the spans."""
    e = search.e
    left = np.where(e.valid, e.residual - search.prediction(base), 0.0)
    places = stretches(e, left)
    if not places:
        return []
    lost = tuple(s for s in spans if (e["place"][within([s], e)] < 0.0).all())
    tried = along(search, base, places, lost)
    fewer = {kept for m in tried if (kept := _worth(search, m, places)) and kept != places}
    tried += [m for kept in fewer for m in along(search, base, kept, lost)]
    best: dict[str, Model] = {}
    for m in sorted(tried, key=lambda m: m.score - enough(search) * len(m.named[-1].variant.places)):
        best[m.effects[-1]] = m
    return list(best.values())


def _worth(search: Search, model: Model, places: Places) -> Places:
    """Those at which a model's last force gains as much as any term must: what is left is never all noise."""
    name = model.effects[-1]
    nats = 0.5 * model.coefficients(name) ** 2 / np.maximum(np.diag(model.covariance(name)), TINY)
    return tuple(place for place, gained in zip(places, nats, strict=False) if gained > enough(search))


def along(search: Search, base: Model, places: Places, lost: tuple[Span, ...]) -> list[Model]:
    """The road's mechanisms as if they acted at these places, and in the spans of drives that are `lost`."""
    terms = [
        _along(given, places, lost, search.e)
        for mechanism in search.library
        if mechanism.effect in BOTH and mechanism.effect not in base.effects
        for given in steady(search, mechanism)
    ]
    return [search.model((*base.named, term), base.free, base.fit) for term in terms]


def instead(search: Search, base: Model, term: CandidateTerm) -> list[Model]:
    """The other name of the road in place of a term that is one; none for any other."""
    if not term.variant.places:
        return []
    lost = itertools.chain(*(part.spans for part in term.variant.parts))
    return along(search, base, term.variant.places, tuple(lost))


def stretches(e: Evidence, left: Array) -> Places:
    """From and to (m along the road) of what stands out together of what is `left` (n,), alike in most
    passes, of which there are two at least."""
    known = e.valid & ~e.held_out & (e["place"] >= 0.0)
    if not known.any():
        return ()
    wide = max(BIN_M, float(e["place"][known].max()) / MOST_BINS)
    bins = np.maximum(e["place"] / wide, 0.0).astype(int)
    passing = _passes(bins, e.record)
    total: Array = np.bincount(bins[known], left[known]).astype(float)
    z = _standardised(total, np.bincount(bins[known]))
    found = [
        (float(abs(z[a:b].sum()) / np.sqrt(b - a)), (wide * a, wide * b))
        for a, b in steps(z, e.rules.stands_out)
        if _alike(left[known & (bins >= a) & (bins < b)], passing[known & (bins >= a) & (bins < b)])
    ]
    return tuple(sorted(place for _, place in sorted(found, reverse=True)[:MOST]))


def _standardised(total: Array, count: NDArray[np.intp]) -> Array:
    """Sums over bins in units of their noise."""
    z = total / np.sqrt(np.maximum(count, 1))
    return z / max(1.4826 * float(np.median(np.abs(z[count > 0]))), 1e-9)


def _passes(bins: NDArray[np.intp], record: NDArray[np.intp]) -> NDArray[np.intp]:
    """The number of the pass that each row is of, (n,): a new one begins with each recording, and where a
    drive comes back to where it was."""
    return np.cumsum(np.concatenate([[True], (np.diff(bins) < -1) | (np.diff(record) != 0)]))


def _alike(left: Array, passing: NDArray[np.intp]) -> bool:
    """Whether what is left goes the same way in most of two or more passes."""
    _, which = np.unique(passing, return_inverse=True)
    means = np.bincount(which, left) / np.bincount(which)
    same = np.sign(means) == np.sign(left.sum())
    return len(means) >= 2 and bool(same.sum() >= 2 and same.mean() > MOSTLY)


def _along(given: CandidateTerm, places: Places, lost: tuple[Span, ...], e: Evidence) -> CandidateTerm:
    """The candidate term along these places and in these spans alone, of a size of its own at each place."""
    each: list[Variant] = [Along(given.variant, (place,)) for place in places]
    each += [Windowed(given.variant, lost)] if lost else []
    made = candidate_term(given.mechanism, Sum(tuple(each)) if len(each) > 1 else each[0], e)
    prior = replace(made.prior, sd=np.full_like(made.prior.sd, BOTH[given.mechanism.effect]))
    ends = ENDS * (len(places) + len(lost))  # each is a choice
    return replace(made, prior=prior, trials=float(np.exp(min(ends, LARGEST_LOG))))
