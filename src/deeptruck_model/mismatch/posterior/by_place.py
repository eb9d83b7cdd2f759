"""Stretches of road that are plainly off whenever a drive comes by: windows in time that share their places.

A window for each pass costs two ends each. One stretch for all passes costs two, and other drives show it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from deeptruck_model.mismatch.mechanisms import CandidateTerm, candidate_term
from deeptruck_model.mismatch.mechanisms.road import BOTH
from deeptruck_model.mismatch.mechanisms.variants import Along, Places, Span, Sum
from deeptruck_model.mismatch.posterior.search import Model, Search
from deeptruck_model.mismatch.posterior.windows import ENDS, LARGEST_LOG, steady, within
from deeptruck_model.mismatch.residual.evidence import Evidence

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

BIN_M, NEAR_M = 10.0, 60.0
MOSTLY = 0.5  # of the passes over a place, in which it is off: it belongs to the place then


def candidates(search: Search, base: Model, spans: list[Span]) -> list[Model]:
    """The road's mechanisms as if they acted along the places of the spans, added to `base` and fitted; none
    where no place is off in most of its passes."""
    found = stretches(search.e, spans)
    if not found:
        return []
    left = np.where(search.e.valid, search.e.residual - search.prediction(base), 0.0)
    either = dict.fromkeys(sharpened(search.e, left, places) for places in (found, _joined(found)))
    return [model for places in either for model in along(search, base, places)]


def along(search: Search, base: Model, places: Places) -> list[Model]:
    """The road's mechanisms as if they acted at these places, added to `base` and fitted."""
    terms = [
        _along(given, places, search.e)
        for mechanism in search.library
        if mechanism.effect in BOTH and mechanism.effect not in base.effects
        for given in steady(search, mechanism)
    ]
    return [search.model((*base.named, term), base.free, base.fit) for term in terms]


def stretches(e: Evidence, spans: list[Span]) -> Places:
    """From and to (m along the road) of what is off in most of the passes over it, of which there are two at
    least."""
    known = e.valid & ~e.held_out & (e["place"] >= 0.0)
    if not known.any():
        return ()
    bins = np.maximum(e["place"] / BIN_M, 0.0).astype(int)
    off, passes = _passes(e, bins, known & within(spans, e)), _passes(e, bins, known)
    inside = (off >= 2) & (off > MOSTLY * passes)
    edges = (BIN_M * np.flatnonzero(np.diff(np.concatenate([[0], inside.astype(int), [0]])))).tolist()
    return tuple((a, b) for a, b in zip(edges[::2], edges[1::2], strict=True) if b - a > BIN_M)


def _joined(places: Places) -> Places:
    """With the gaps that are shorter than what lies on both sides: shifts hide a part of each pass."""
    out = [places[0]]
    for first, last in places[1:]:
        begin, end = out[-1]
        near = first - end < (end - begin) + (last - first)
        out[-1:] = [(begin, last)] if near else [out[-1], (first, last)]
    return tuple(out)


def sharpened(e: Evidence, left: Array, places: Places) -> Places:
    """The stretches with the ends, at most NEAR_M away, between which one force explains most of what is left
    (n,): windows of a few passes are wide by the noise."""
    known = e.valid & ~e.held_out & (e["place"] >= 0.0)
    bins = np.maximum(e["place"] / BIN_M, 0.0).astype(int)[known]
    size = int(bins.max()) + 1
    total = np.concatenate([[0.0], np.cumsum(np.bincount(bins, left[known], size))])
    count = np.concatenate([[0.0], np.cumsum(np.bincount(bins, minlength=size))])
    out: list[tuple[float, float]] = []
    for first, last in places:
        before = int(out[-1][1] / BIN_M) if out else 0
        a, b = (_around(end, before, size) for end in (first, last))
        force, n = total[b][None, :] - total[a][:, None], count[b][None, :] - count[a][:, None]
        explained = np.where(a[:, None] < b[None, :], force**2 / np.maximum(n, 1.0), -1.0)
        i, k = np.unravel_index(int(np.argmax(explained)), explained.shape)
        out.append((BIN_M * float(a[i]), BIN_M * float(b[k])))
    return tuple(out)


def _around(end: float, least: int, most: int) -> NDArray[np.intp]:
    """Bins at most NEAR_M from an end."""
    return np.arange(max(int((end - NEAR_M) / BIN_M), least), min(int((end + NEAR_M) / BIN_M), most) + 1)


def _passes(e: Evidence, bins: NDArray[np.intp], rows: Mask) -> NDArray[np.intp]:
    """How often each place is passed in these rows: a pass begins where a drive comes to it anew."""
    anew = np.concatenate([[True], (np.diff(bins) != 0) | (np.diff(e.record) != 0) | ~rows[:-1]])
    return np.bincount(bins[rows & anew], minlength=int(bins.max()) + 1)


def _along(given: CandidateTerm, places: Places, e: Evidence) -> CandidateTerm:
    """The candidate term along these places alone, of a size of its own at each."""
    each = tuple(Along(given.variant, (place,)) for place in places)
    made = candidate_term(given.mechanism, Sum(each) if len(each) > 1 else each[0], e)
    prior = replace(made.prior, sd=np.full_like(made.prior.sd, BOTH[given.mechanism.effect]))
    looked_for = float(np.exp(min(ENDS * len(places), LARGEST_LOG)))  # each end is a choice
    return replace(made, prior=prior, trials=looked_for)
