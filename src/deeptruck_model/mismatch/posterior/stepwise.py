"""From nothing to a model: mechanisms are added, dropped and exchanged while the evidence asks for it."""

from __future__ import annotations

from weakref import WeakKeyDictionary

import numpy as np

from deeptruck_model.mismatch.mechanisms import CandidateTerm, candidate_term, is_time_varying
from deeptruck_model.mismatch.mechanisms.commands import Delays
from deeptruck_model.mismatch.mechanisms.variants import Static
from deeptruck_model.mismatch.posterior import by_place, windows
from deeptruck_model.mismatch.posterior.candidates import candidates, enriched
from deeptruck_model.mismatch.posterior.penalties import (
    discrepancy_penalty,
    enough,
    practical,
    time_varying_penalty,
)
from deeptruck_model.mismatch.posterior.search import MOST_TERMS, Model, Search

WIDENED = 4  # of the best names are given more freedom of form before the first is chosen
EXCHANGES = 3
SETTLING = 2  # times


_first: WeakKeyDictionary[Search, list[Model]] = WeakKeyDictionary()  # a search is large: no longer than it


def _first_options(search: Search) -> list[Model]:
    """Every mechanism beside the parameters alone, best first; found once, as it takes the longest."""
    if search not in _first:
        _first[search] = candidates(search, search.background(()))
    return _first[search]


def first_guess(search: Search) -> Model:
    """Parameters alone, or with the one best mechanism: enough to see how far the parameters are off."""
    base = search.background(())
    best = max(_first_options(search), key=lambda m: m.score, default=base)
    return best if best.score > base.score + enough(search) + discrepancy_penalty(search, best) else base


def grow(search: Search, base: Model) -> tuple[Model, tuple[tuple[str, float], ...]]:
    """Add the best mechanism while it is worth it; then drop those that no longer are."""
    ranking: tuple[tuple[str, float], ...] = ()
    bare = base
    while len(base.named) < MOST_TERMS:
        options = candidates(search, base) if base.named else _first_options(search)
        if not ranking:
            ranking = tuple((m.effects[-1], m.score - base.score) for m in options)
        more = _one_more(search, base, bare, options)
        if more is base:
            break
        base = more
    while len(base.named) > 1:
        without = [search.background(tuple(n for n in base.named if n is not s)) for s in base.named]
        weakest = max(without, key=lambda m: m.score)
        gone = next(s for s in base.named if all(s is not n for n in weakest.named))
        share = _beside(search, search.background((*weakest.named, gone)))
        if weakest.score < base.score - enough(search) - share * (base.score - bare.score):
            break
        base = weakest
    base = _settled(search, _exchanged(search, base))
    best = max(_rare(search, base, bare), key=lambda m: m.score - _for_freedom(m, bare))
    gave_way = any(all(s is not n for n in best.named) for s in base.named)
    if gave_way and len(best.named) < MOST_TERMS:  # it may be there as well
        best = _one_more(search, best, bare, candidates(search, best))
    return best, ranking


def _one_more(search: Search, base: Model, bare: Model, options: list[Model]) -> Model:
    """The best of the options, each one name more than `base`, where it is worth it; else `base`."""
    options = [m for m in options if practical(search, m, m.named[-1])]
    options = [
        enriched(search, m) for m in options[:WIDENED] if m.score > base.score + search.rules.least_gain / 2
    ]
    best = max(
        options,
        key=lambda m: m.score - discrepancy_penalty(search, m) - time_varying_penalty(m, base),
        default=base,
    )
    least = (
        enough(search) + discrepancy_penalty(search, best) + _beside(search, best) * (base.score - bare.score)
    )
    least += time_varying_penalty(best, base)
    return base if best.score < base.score + least else search.background(best.named)


def _rare(search: Search, base: Model, bare: Model) -> list[Model]:
    """The model with what acts in a few windows alone, and the same without what is time-varying, whose knots
    follow such windows too, and without any law, which may stand in for it."""
    lasting = tuple(s for s in base.named if not is_time_varying(s))
    found = _now_and_then(search, base, bare)
    slow = found is base and len(lasting) < len(base.named)
    instead = [search.background(lasting)] if slow else []
    if base.named and all(m is not bare for m in instead):
        instead.append(bare)
    instead = [m for m in instead if _gains_in_windows(search, base, m)]
    return [found, *(_now_and_then(search, m, bare) for m in instead), *_stretches(search, base, bare)]


def _stretches(search: Search, base: Model, bare: Model) -> list[Model]:
    """The models with stretches of road instead of knots along it, which are rounder, and of windows in time,
    which each pass needs anew; and the same without any law."""
    others = (s for s in base.named if not (s.variant.comes_again or s.variant.acts_in_windows))
    starts = {id(m): m for m in (search.background(tuple(others)), bare) if len(m.named) < MOST_TERMS}
    return [m for start in starts.values() for m in _with_stretches(search, start)]


def _with_stretches(search: Search, base: Model) -> list[Model]:
    tried = [m for m in by_place.candidates(search, base) if practical(search, m, m.named[-1])]
    best = max(tried, key=lambda m: m.score, default=base)
    least = enough(search) + discrepancy_penalty(search, best)
    return [search.background(best.named)] if best.score > base.score + least else []


def _gains_in_windows(search: Search, model: Model, without: Model) -> bool:
    """Whether half of what a model gains lies in windows in which it is plainly wrong without; where it does
    not, what acts there alone is no better."""
    inside = windows.within(windows.windows(search.e, without), search.e)
    gained = model.fit.pointwise - without.fit.pointwise
    return bool(inside.any() and gained[inside].sum() > 0.5 * gained.sum())


def _for_freedom(model: Model, bare: Model) -> float:
    """Nats by which what is time-varying must do better, and what acts in windows that were chosen for it."""
    varying = model.rules.least_gain if any(is_time_varying(s) for s in model.named) else 0.0
    chosen = model.rules.form_share if any(s.variant.acts_in_windows for s in model.named) else 0.0
    return varying + chosen * (model.score - bare.score)


def _settled(search: Search, model: Model) -> Model:
    """Delays are linear about the amounts that were tried; they are fitted again about what that gave."""
    for _ in range(SETTLING):
        moved = tuple(_about_its_size(search, model, s) for s in model.named)
        settled = search.model(moved, model.free, model.fit)
        if settled.score < model.score:
            return model
        model = settled
    return model


def _about_its_size(search: Search, model: Model, s: CandidateTerm) -> CandidateTerm:
    """A candidate term of delays at the delays it was fitted to; any other as it is."""
    if not (isinstance(s.variant, Static) and isinstance(s.variant.constants, Delays)):
        return s
    sizes = model.coefficients(s.mechanism.effect).tolist()
    lines = zip(s.variant.constants.lines, sizes, strict=True)
    fitted = tuple((which, round(tau_s * b, 3)) for (which, tau_s), b in lines)
    return candidate_term(s.mechanism, Static(Delays(fitted)), search.e)


def _beside(search: Search, model: Model) -> float:
    """The share of the others' gain that the last name of a model must gain.

    What a form leaves wrong lies where it acts, so that a force that acts elsewhere is one of its own.
    """
    forces = [s.columns @ model.coefficients(s.mechanism.effect) for s in model.named]
    if len(forces) < 2:
        return search.rules.other_share
    last, others = np.abs(forces[-1]), np.abs(sum(forces[:-1], start=np.zeros(len(search.e))))
    sizes = float(np.sqrt(np.sum(last**2) * np.sum(others**2)))
    together = float(last @ others) / max(sizes, 1e-12)
    return search.rules.coarse + (search.rules.other_share - search.rules.coarse) * together


def _now_and_then(search: Search, base: Model, bare: Model) -> Model:
    """Add a mechanism that acts in a few windows alone, where one explains them."""
    spans = windows.windows(search.e, base) if search.e.model_discrepancy == 0 else []
    if not spans:
        return base
    narrow = windows.narrowed(search, base, spans)
    tried = [m for where in (spans, narrow) for m in windows.candidates(search, base, where)]
    tried = [m for m in tried if practical(search, m, m.named[-1])]
    best = max(tried, key=lambda m: m.score, default=base)
    least = search.rules.weak + _beside(search, best) * (base.score - bare.score)
    return best if best.score > base.score + least else base


def _exchanged(search: Search, model: Model) -> Model:
    """Each mechanism in turn gives way to one that does better beside the others: the first was chosen
    alone."""
    for _ in range(EXCHANGES):
        before = model
        for given in model.named:
            others = tuple(n for n in model.named if n is not given)
            base = search.background(others)
            options = [
                enriched(search, m)
                for m in candidates(search, base)[:WIDENED]
                if practical(search, m, m.named[-1])
            ]
            best = max(
                options,
                key=lambda m: m.score - discrepancy_penalty(search, m) - time_varying_penalty(m, base),
                default=model,
            )
            better = search.background(best.named)
            own = time_varying_penalty(search.model((*others, given), model.free, model.fit), base)
            if better.score - time_varying_penalty(better, base) > model.score - own + search.rules.temper:
                model = better
                break
        if model is before:
            break
    return model
