"""Approximate gains of many candidate terms at once, by which those worth a fit are chosen."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from deeptruck_model.mismatch.expression import Rerun
from deeptruck_model.mismatch.mechanisms import CandidateTerm, is_time_varying, merge
from deeptruck_model.mismatch.mechanisms.regimes import Products
from deeptruck_model.mismatch.mechanisms.variants import Gated
from deeptruck_model.mismatch.posterior.penalties import time_varying_penalty
from deeptruck_model.mismatch.posterior.search import Model, Search
from deeptruck_model.mismatch.residual.noise import whiten

Array = NDArray[np.float64]

SCREENED = 2  # candidate terms of each mechanism that are fitted in full
FEW_COLUMNS = 8  # of candidate terms that are confined to a regime before they are fitted
CONFINED = 3  # so many candidate terms of each mechanism


def screen(search: Search, base: Model, noise: Model | None = None) -> list[tuple[float, CandidateTerm]]:
    """Approximate gain of the best terms of every mechanism on top of `base`, best first; the noise is
    that of `noise`, or of `base`."""
    out = []
    taken = any(is_time_varying(n) for n in base.named)
    for mechanism in search.library:
        if mechanism.effect not in base.effects:
            scored = screen_terms(search, base, search.candidate_terms(mechanism), noise)
            laws = [item for item in scored if not is_time_varying(item[1])]
            out += laws[:SCREENED] + _screen_confined(search, base, laws, noise)
            if not taken:  # two time-varying forces are not distinguishable from one
                out += [item for item in scored if is_time_varying(item[1])][:1]
    return sorted(out, key=lambda item: -item[0])


def _screen_confined(
    search: Search, base: Model, laws: list[tuple[float, CandidateTerm]], noise: Model | None
) -> list[tuple[float, CandidateTerm]]:
    """The best law of a mechanism that gains clearly more where it acts in one regime alone; or none."""
    few = [s for _, s in laws if s.columns.shape[1] <= FEW_COLUMNS][:CONFINED]
    few = [s for s in few if s.mechanism.confinable]
    regimes = [r for s in few for r in screen_regimes(search, base, s, noise)[:1]]
    better = [r for r in regimes if r[0] > laws[0][0] + search.rules.temper]
    return sorted(better, key=lambda item: -item[0])[:1]


def screen_terms(
    search: Search, base: Model, options: Sequence[CandidateTerm], noise: Model | None = None
) -> list[tuple[float, CandidateTerm]]:
    """Approximate gain of each candidate term on top of `base`, best first."""
    noise = noise or base
    yw, Xw, H0, weight = search.whitened(base, noise)
    Xty, scored = Xw.T @ yw, []
    for s in options:
        C = whiten(s.columns, noise.fit.ar, search.rows, weight)
        gain = float(_approximate_gains(Products.stacked([Products.of(C, yw, Xw)]), Xty, H0, s)[0])
        scored.append((gain - search.rules.temper * float(np.log(s.trials)), s))
    return sorted(scored, key=lambda item: -item[0])


def screen_regimes(
    search: Search, base: Model, term: CandidateTerm, noise: Model | None = None
) -> list[tuple[float, CandidateTerm]]:
    """Approximate gain of a term confined to one side of each border, best first; the best alone are
    made. The noise is that of `noise`, or of `base`."""
    if any(isinstance(c.expression, Rerun) for c in term.parts) or term.variant.gate:
        return []
    noise = noise or base
    yw, Xw, H0, weight = search.whitened(base, noise)
    C = whiten(term.columns, noise.fit.ar, search.rows, weight)
    gates, products = search.regimes.products(C, yw, Xw)
    if not gates:
        return []
    gains = _approximate_gains(products, Xw.T @ yw, H0, term)
    lies_there = np.trace(products.CtC, axis1=1, axis2=2) > search.rules.form_share * float(np.sum(C**2))
    best = [k for k in np.argsort(-gains, kind="stable") if lies_there[k]][:SCREENED]
    made = [(float(gains[k]), search.regimes.gated(term, gates[k], search.e)) for k in best]
    return [(gain - search.rules.temper * float(np.log(s.trials)), s) for gain, s in made]


def _approximate_gains(products: Products, Xty: Array, H0: Array, s: CandidateTerm) -> Array:
    """Evidence (G,) gained by more columns, all whitened and weighted, of G sets of products; signs are
    respected one by one."""
    XtC = products.XtC
    CtX = XtC.swapaxes(1, 2)
    A = products.CtC - CtX @ (H0 @ XtC)
    at_zero = products.Cty - CtX @ (H0 @ Xty)
    P, m = 1 / s.prior.sd**2, s.prior.mean
    H = A + np.diag(P)
    g = at_zero - A @ m
    step = np.linalg.solve(H, g[:, :, None])[:, :, 0]
    gain = 0.5 * np.sum(g * step, axis=1) - 0.5 * (np.linalg.slogdet(H)[1] - np.log(P).sum())
    gain += at_zero @ m - 0.5 * (A @ m) @ m  # moving by the prior mean itself counts too
    if (s.prior.sign > 0).any():
        gain[((step + m) * s.prior.sign < 0).all(axis=1)] = -10.0
    out: Array = gain
    return out


MORE_TERMS = 2  # further candidate terms a mechanism may be widened by
MOST_COLUMNS = 8  # of a term that another is widened by
FITTED = 8  # mechanisms that are fitted in full in each round
SECOND_TERMS = 9  # among the first of these, more than one candidate term of a mechanism that lasts
LEADING = 4  # mechanisms also tried without freeing the parameters


def candidates(search: Search, base: Model) -> list[Model]:
    """Every mechanism added to `base`, fitted in full with its parameters free and held, best first.

    The noise beside `base` alone holds what is missing, and so hides some of the names for it; they are
    looked for again under the noise beside the best of the first.
    """

    def worth(model: Model) -> float:
        return model.score - time_varying_penalty(model, base)

    best = _fitted(search, base, screen(search, base), {})
    if best:
        leader = max(best.values(), key=worth)
        best = _fitted(search, base, screen(search, base, leader), best, leader)
    leading = sorted(best.values(), key=worth, reverse=True)
    for model in leading[:LEADING]:
        held = search.model(model.named, base.free, base.fit)
        if held.score > model.score:
            best[model.effects[-1]] = held
    return sorted(best.values(), key=worth, reverse=True)


def _fitted(
    search: Search,
    base: Model,
    screened: list[tuple[float, CandidateTerm]],
    best: dict[str, Model],
    leader: Model | None = None,
) -> dict[str, Model]:
    """The best model of each of the first FITTED effects that were screened, and of those in `best`; from
    the noise of the leader where there is one."""
    everything = frozenset(search.parameters)
    best, seen, lasting = dict(best), set[str](), set[str]()
    for rank, (_, term) in enumerate(screened):
        effect = term.mechanism.effect
        if effect not in seen and len(seen) >= FITTED:
            continue
        if effect in lasting and rank >= SECOND_TERMS and not is_time_varying(term):
            continue
        seen.add(effect)
        if not is_time_varying(term):
            lasting.add(effect)
        named, start = (*base.named, term), (leader or base).fit
        model = search.model(named, everything, start, again=leader is not None)
        worth = model.score - time_varying_penalty(model, base)
        if effect not in best or worth > best[effect].score - time_varying_penalty(best[effect], base):
            best[effect] = model
    return best


def enriched(search: Search, model: Model) -> Model:
    """The same explanation with its last mechanism given more freedom where that pays.

    First it may be confined to a regime of driving, then widened by more of its candidate terms.
    """
    last = model.named[-1]
    if not last.mechanism.confinable:
        return model
    model = _confined(search, model)
    if is_time_varying(last):
        return model
    for _ in range(MORE_TERMS):
        *others, last = model.named
        options = [
            search.model((*others, merge(last, s)), model.free, model.fit)
            for s in search.candidate_terms(last.mechanism)
            if s.variant not in last.variant.parts
            and s.columns.shape[1] <= MOST_COLUMNS
            and not is_time_varying(s)
        ]
        best = max(options, key=lambda m: m.score, default=model)
        if best.score < model.score + search.rules.temper:
            break
        model = best
    return model


def _confined(search: Search, model: Model) -> Model:
    *others, last = model.named
    base = search.model(tuple(others), model.free, model.fit)
    confined = [s for _, s in screen_regimes(search, base, _everywhere(search, last), model)]
    options = [search.model((*others, s), model.free, model.fit) for s in confined]
    best = max(options, key=lambda m: m.score, default=model)
    return best if best.score > model.score + search.rules.temper else model


def _everywhere(search: Search, term: CandidateTerm) -> CandidateTerm:
    """The term that was confined to a regime, without it: its border was chosen under other noise."""
    plain = term.variant.of if isinstance(term.variant, Gated) else term.variant
    return next((s for s in search.candidate_terms(term.mechanism) if s.variant == plain), term)
