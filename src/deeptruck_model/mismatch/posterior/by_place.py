"""Stretches of road that are off whenever a drive comes by.

A window in time needs two ends in each pass. A stretch has two for all passes, and other drives show it.
"""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from deeptruck_model.mismatch.mechanisms import CandidateTerm, Column, candidate_term
from deeptruck_model.mismatch.mechanisms.road import BOTH
from deeptruck_model.mismatch.mechanisms.variants import Along, Places, Span, Sum, Variant, Windowed
from deeptruck_model.mismatch.posterior.penalties import enough
from deeptruck_model.mismatch.posterior.search import Model, Search
from deeptruck_model.mismatch.posterior.windows import ENDS, LARGEST_LOG, steady, steps
from deeptruck_model.mismatch.residual.evidence import Evidence

Array = NDArray[np.float64]

BIN_M, BIN_S, MOST_BINS = 10.0, 1.0, 2000  # wider where the road, or a drive, is long
FINER = 10  # ends are told to so many parts of a bin
TINY = 1e-12  # of a size that is held at zero
MOST = 16  # stretches, those that stand out most
MOSTLY = 0.5  # of the passes over a stretch, of which more must be off the same way


def candidates(search: Search, base: Model) -> list[Model]:
    """The road's mechanisms as if they acted along stretches of it alone, added to `base` and fitted; none
    where none stands out. In drives whose place nobody knows they act in spans of time."""
    e = search.e
    left = np.where(e.valid, e.residual - search.prediction(base), 0.0)
    places = stretches(e, left)
    if not places:
        return []
    tried = along(search, base, places, ())
    told = max(tried, key=lambda m: m.score, default=base)  # no parameter stands in for the road any more
    lost = _lost(e, np.where(e.valid, e.residual - search.prediction(told), 0.0))
    tried += along(search, base, places, lost) if lost else []
    fewer = {_worth(search, m) for m in tried} - {(places, lost), (places, ())}
    tried += [m for kept in fewer if kept[0] for m in along(search, base, *kept)]
    best: dict[str, Model] = {}
    for m in sorted(tried, key=lambda m: m.score - enough(search) * len(m.named[-1].variant.parts)):
        best[m.effects[-1]] = m
    return list(best.values())


def _worth(search: Search, model: Model) -> tuple[Places, tuple[Span, ...]]:
    """Those at which a model's last force gains as much as any term must: what is left is never all noise."""
    name = model.effects[-1]
    nats = 0.5 * model.coefficients(name) ** 2 / np.maximum(np.diag(model.covariance(name)), TINY)
    parts = model.named[-1].variant.parts
    kept = [part for part, gained in zip(parts, nats, strict=True) if gained > enough(search)]
    return tuple(p for part in kept for p in part.places), tuple(s for part in kept for s in part.spans)


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


def _lost(e: Evidence, left: Array) -> tuple[Span, ...]:
    """Spans in which what stands out of what is `left` (n,) does so in drives that share no place with
    others, those that stand out most: the road may do there what it does in the others. None beside a learned
    simulator, which is off now and then anyway."""
    if e.model_discrepancy > 0.0:
        return ()
    found: list[tuple[float, Span]] = []
    for i, s in enumerate(e.stretches):
        known = e.valid[s.rows]
        if s.held_out or not known.any() or _meets(e, i):
            continue
        elapsed, own = e["elapsed"][s.rows][known], left[s.rows][known]
        found += [(off, (i, a, b)) for off, a, b in _stands_out(elapsed, own, BIN_S, e.rules.stands_out)]
    return tuple(sorted(span for _, span in sorted(found, reverse=True)[:MOST]))


def stretches(e: Evidence, left: Array) -> Places:
    """From and to (m along the road) of what stands out together of what is `left` (n,), alike in most
    passes, of which there are two at least."""
    known = e.valid & ~e.held_out & (e["place"] >= 0.0)
    if not known.any():
        return ()
    place, own, passing = e["place"][known], left[known], _passes(e["place"], e.record)[known]
    found = [
        (off, (a, b))
        for off, a, b in _stands_out(place, own, BIN_M, e.rules.stands_out)
        if _alike(own[(place >= a) & (place < b)], passing[(place >= a) & (place < b)])
    ]
    return tuple(sorted(where for _, where in sorted(found, reverse=True)[:MOST]))


def _stands_out(x: Array, left: Array, wide: float, off: float) -> list[tuple[float, float, float]]:
    """By how many sd of its noise, and from where to where of `x` (n,), what is `left` (n,) is off together,
    by `off` sd at least. Found in bins as `wide`, or wider where there would be too many."""
    wide = max(wide, float(np.ptp(x)) / MOST_BINS)
    first = wide * float(np.floor(x.min() / wide))
    bins = ((x - first) / wide).astype(int)
    z = _standardised(np.bincount(bins, left).astype(float), np.bincount(bins))
    return [
        (float(abs(z[a:b].sum()) / np.sqrt(b - a)), *_ends(x, left, first + wide * a, first + wide * b, wide))
        for a, b in steps(z, off)
    ]


def _meets(e: Evidence, i: int) -> bool:
    """Whether a drive comes by where another one does that is fitted too: held-out ones show nothing here."""
    place, own = np.floor(e["place"] / BIN_M), e.record == i
    return bool(np.isin(place[own & (place >= 0.0)], place[~own & ~e.held_out]).any())


def _ends(x: Array, left: Array, begin: float, end: float, wide: float) -> tuple[float, float]:
    """From where to where of `x` (n,) near `begin` and `end`, each known to `wide`, what is `left` (n,)
    stands out most."""
    order = np.argsort(x, kind="stable")
    total = np.concatenate([[0.0], np.cumsum(left[order])])
    near = np.linspace(-wide, wide, 2 * FINER + 1)
    first, last = np.searchsorted(x[order], begin + near), np.searchsorted(x[order], end + near)
    count = np.maximum(last[None, :] - first[:, None], 1)
    a, b = np.unravel_index(
        np.argmax(np.abs(total[last][None, :] - total[first][:, None]) / np.sqrt(count)), count.shape
    )
    return float(begin + near[a]), float(end + near[b])


def _standardised(total: Array, count: NDArray[np.intp]) -> Array:
    """Sums over bins in units of their noise."""
    z = total / np.sqrt(np.maximum(count, 1))
    return z / max(1.4826 * float(np.median(np.abs(z[count > 0]))), 1e-9)


def _passes(place: Array, record: NDArray[np.intp]) -> NDArray[np.intp]:
    """The number of the pass that each row is of, (n,): a new one begins with each recording, and where a
    drive comes back to where it was."""
    bins = np.floor(place / BIN_M)
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
    each += [Windowed(given.variant, (span,)) for span in lost]
    made = candidate_term(given.mechanism, Sum(tuple(each)) if len(each) > 1 else each[0], e)
    prior = replace(made.prior, sd=np.full_like(made.prior.sd, BOTH[given.mechanism.effect]))
    ends = ENDS * (len(places) + len(lost))  # each is a choice
    parts = tuple(_in_drive(part, v, e) for part, v in zip(made.parts, each, strict=True))
    return replace(made, parts=parts, prior=prior, trials=float(np.exp(min(ends, LARGEST_LOG))))


def _in_drive(part: Column, of: Variant, e: Evidence) -> Column:
    """The column of a span named by its drive and times; any other as it is."""
    where = ", ".join(f"{e.stretches[i].name}, {a:.0f} to {b:.0f} s" for i, a, b in of.spans)
    return replace(part, name=f"{part.name}[{where}]") if where else part
