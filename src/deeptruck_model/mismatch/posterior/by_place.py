"""Stretches of road that are plainly off whenever a drive comes by: windows in time that share their places.

A window for each pass costs two ends each. One stretch for all passes costs two, and other drives show it.
"""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from deeptruck_model.mismatch.mechanisms import CandidateTerm, candidate_term
from deeptruck_model.mismatch.mechanisms.road import BOTH
from deeptruck_model.mismatch.mechanisms.variants import Along, Places, Span, Sum, Variant, Windowed
from deeptruck_model.mismatch.posterior.search import Model, Search
from deeptruck_model.mismatch.posterior.windows import ENDS, LARGEST_LOG, steady, steps, within
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.residual.noise import Z95

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

BIN_M, NEAR = 10.0, 10  # and so many bins about a place in which its ends are sought
MOSTLY = 0.5  # of the passes over a place, in which it is off: it belongs to the place then


def candidates(search: Search, base: Model, spans: list[Span]) -> list[Model]:
    """The road's mechanisms as if they acted along the places of the spans, added to `base` and fitted; none
    where no place is off in most of its passes. In drives whose place nobody knows they act in the spans."""
    e = search.e
    left = np.where(e.valid, e.residual - search.prediction(base), 0.0)
    places = stretches(e, left, spans)
    lost = tuple(s for s in spans if (e["place"][within([s], e)] < 0.0).all())
    if not places:
        return []
    tried = along(search, base, places, lost)
    fewer = {kept for m in tried if (kept := _surely(m, places)) and kept != places}
    return [*tried, *(m for kept in fewer for m in along(search, base, kept, lost))]


def _surely(model: Model, places: Places) -> Places:
    """Those at which a model's last force is surely not zero: other parameters leave a little anywhere."""
    name = model.effects[-1]
    sizes, sd = model.coefficients(name), np.sqrt(np.diag(model.covariance(name)))
    return tuple(p for p, size, doubt in zip(places, sizes, sd, strict=False) if abs(size) > Z95 * doubt)


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
    lost = (part.spans for part in term.variant.parts)
    return (
        along(search, base, term.variant.places, tuple(itertools.chain(*lost))) if term.variant.places else []
    )


def stretches(e: Evidence, left: Array, spans: list[Span]) -> Places:
    """From and to (m along the road) of what stands out together of what is `left` (n,), about the places
    that are off in most passes, of which there are two at least."""
    known = e.valid & ~e.held_out & (e["place"] >= 0.0)
    if not known.any():
        return ()
    bins = np.maximum(e["place"] / BIN_M, 0.0).astype(int)
    off, passes = _passes(e, bins, known & within(spans, e)), _passes(e, bins, known)
    often = (off >= 2) & (off > MOSTLY * passes)
    size = len(often)
    z = np.bincount(bins[known], left[known], size) / np.sqrt(
        np.maximum(np.bincount(bins[known], None, size), 1)
    )
    z /= max(1.4826 * float(np.median(np.abs(z[passes > 0]))), 1e-9)
    near = np.convolve(often, np.ones(2 * NEAR + 1), mode="same") > 0.5
    edges = np.flatnonzero(np.diff(np.concatenate([[0], near.astype(int), [0]])))
    found = [
        (BIN_M * float(first + a), BIN_M * float(first + b))
        for first, last in zip(edges[::2], edges[1::2], strict=True)
        for a, b in steps(z[first:last], e.rules.stands_out)
    ]
    return tuple(found)


def _passes(e: Evidence, bins: NDArray[np.intp], rows: Mask) -> NDArray[np.intp]:
    """How often each place is passed in these rows: a pass begins where a drive comes to it anew."""
    anew = np.concatenate([[True], (np.diff(bins) != 0) | (np.diff(e.record) != 0) | ~rows[:-1]])
    return np.bincount(bins[rows & anew], minlength=int(bins.max()) + 1)


def _along(given: CandidateTerm, places: Places, lost: tuple[Span, ...], e: Evidence) -> CandidateTerm:
    """The candidate term along these places and in these spans alone, of a size of its own at each place."""
    each: list[Variant] = [Along(given.variant, (place,)) for place in places]
    each += [Windowed(given.variant, lost)] if lost else []
    made = candidate_term(given.mechanism, Sum(tuple(each)) if len(each) > 1 else each[0], e)
    prior = replace(made.prior, sd=np.full_like(made.prior.sd, BOTH[given.mechanism.effect]))
    ends = ENDS * (len(places) + len(lost))  # each is a choice
    return replace(made, prior=prior, trials=float(np.exp(min(ends, LARGEST_LOG))))
