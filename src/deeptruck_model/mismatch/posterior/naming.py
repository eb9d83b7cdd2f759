"""Each finding among all names, by what its fingerprint is like."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from deeptruck_model.mismatch.mechanisms import LIBRARY, CandidateTerm
from deeptruck_model.mismatch.mechanisms.variants import Gate
from deeptruck_model.mismatch.posterior.candidates import enriched, screen_terms
from deeptruck_model.mismatch.posterior.causes import Cause, Explanation
from deeptruck_model.mismatch.posterior.kernel_evidence import KernelEvidence
from deeptruck_model.mismatch.posterior.kernels import NOTHING, UNKNOWN
from deeptruck_model.mismatch.posterior.penalties import enough, practical
from deeptruck_model.mismatch.posterior.recogniser import recogniser
from deeptruck_model.mismatch.posterior.search import MOST_TERMS, Model, Search

Array = NDArray[np.float64]

TRIED = 2  # candidate terms of a name that are fitted in full
ALIKE = 0.01  # of what was gained, by which names may differ that are one force: no likeness tells these


class Likeness:
    """What the recogniser says of the residual of a search, under the noise beside a model."""

    def __init__(self, search: Search, model: Model) -> None:
        self._search, self._model = search, model
        self._by: dict[Gate | None, KernelEvidence] = {}

    def of(
        self, force: Array, others: Collection[str], term: CandidateTerm | None = None
    ) -> dict[str, float]:
        """The probability of every name beside `others`, and that nothing more is missing there. The engine's
        recorded torque speaks of `force` (n,), what the best explanation so far takes it to be. A `term` that
        is confined to a regime is judged by what is seen there."""
        kernels = self._kernels(term)
        seen = kernels.of(self._search.series.y[:, None], sorted(others))
        if others and seen.held.nats.max() < self._search.rules.least_gain:
            return {NOTHING: 1.0}
        by = recogniser()
        log_p = np.log(np.maximum(by.told(seen)[0], 1e-12))
        log_p += np.array([kernels.reported(force, name) for name in by.names]) / seen.held.unit[0]
        p = np.exp(log_p - log_p.max()) * np.array([name not in others for name in by.names])
        return dict(zip(by.names, (p / p.sum()).tolist(), strict=True))

    def nothing_more(self, force: Array, others: Collection[str], term: CandidateTerm | None = None) -> bool:
        """Whether it is more probable than not that what others leave is but their forms' error."""
        return self.of(force, others, term).get(NOTHING, 0.0) > 0.5

    def _kernels(self, term: CandidateTerm | None) -> KernelEvidence:
        """Along all rows, or those of the regime that a term is confined to; made once."""
        gate = None if term is None else term.variant.gate
        if gate not in self._by:
            where = None if gate is None else self._search.regimes.inside(gate)
            self._by[gate] = KernelEvidence(self._search, self._model, where)
        return self._by[gate]


def renamed(search: Search, model: Model) -> Model:
    """The model, each law in it by a form of the name that it is most like, where that weighs more than what
    this form explains less.

    The search chose the form that is nearest; the recogniser knows which laws have no form here, and what
    they look like then.
    """
    laws = [term for term in model.named if _acts_throughout(term)]
    if not laws:
        return model
    likeness = Likeness(search, model)
    for term in laws:
        others = tuple(t for t in model.named if t is not term)
        force = term.columns @ model.coefficients(term.mechanism.effect)
        told = likeness.of(force, {t.mechanism.effect for t in others}, term)
        best = _likest(search, told)
        liker = told.get(best, 0.0) - told.get(term.mechanism.effect, 0.0)
        other = _by_the_name(search, model, others, best) if liker > 0.0 else None
        # its form is what corrects, so that here forms weigh as much as likeness
        if other is not None and liker > np.tanh(_lost(search, model, other, others) / 2.0):
            model = other
    return model


def asked_for(search: Search, model: Model) -> Model:
    """The model without laws that are more like what the others' forms leave over than like any name: the
    weakest first, as the others explain the more without it. Not so parameters: to a recogniser what forms
    leave looks like them."""
    likeness = Likeness(search, model)
    for term in sorted(filter(_acts_throughout, model.named), key=lambda t: _alone_gains(search, model, t)):
        others = tuple(t for t in model.named if t is not term)
        force = term.columns @ model.coefficients(term.mechanism.effect)
        if others and likeness.nothing_more(force, {t.mechanism.effect for t in others}, term):
            model = search.background(others)
    return model


def _alone_gains(search: Search, model: Model, term: CandidateTerm) -> float:
    return model.score - search.background(tuple(t for t in model.named if t is not term)).score


def _lost(search: Search, model: Model, other: Model, others: Sequence[CandidateTerm]) -> float:
    """By how much the forms of another name explain less, in nats as those between names count."""
    gain = model.score - search.background(tuple(others)).score
    return (model.score - other.score) / max(search.rules.temper, search.rules.coarse * gain)


def with_the_rest(search: Search, model: Model, rest: Array) -> Model:
    """The model with one name more, where what it leaves over, `rest` (n,), is more like a name than like
    nothing known, and that name's own forms explain enough of it."""
    if len(model.named) >= MOST_TERMS:
        return model
    told = Likeness(search, model).of(rest, set(model.effects))
    best = _likest(search, told)
    if told.get(best, 0.0) <= max(told.get(UNKNOWN, 0.0), told.get(NOTHING, 0.0)) or best in model.effects:
        return model
    return _by_the_name(search, model, model.named, best) or model


def _likest(search: Search, told: Mapping[str, float]) -> str:
    """The most probable name of the library."""
    return max((m.effect for m in search.library), key=lambda name: told.get(name, 0.0), default="")


def _by_the_name(search: Search, model: Model, others: Sequence[CandidateTerm], name: str) -> Model | None:
    """The model beside others in the best form of a name; None where that explains too little."""
    base = search.background(tuple(others))
    scored = screen_terms(search, base, search.candidate_terms(LIBRARY[name]))[:TRIED]
    fitted = [search.model((*others, term), base.free | model.free, model.fit) for _, term in scored]
    made = [m for m in (enriched(search, m) for m in fitted) if practical(search, m, m.named[-1])]
    best = max(made, key=lambda m: m.score, default=base)
    best = search.background(best.named)
    return best if best.score > base.score + enough(search) else None


def recognised(search: Search, found: Explanation) -> Explanation:
    """The explanation, each finding with the probabilities of names that the recogniser gives it beside the
    others.

    What acts in windows alone, at places that come again, or slowly, has none.
    """
    if not any(map(_has_a_likeness, found.causes)):
        return found
    likeness = Likeness(search, found.model)
    left = found.left_over_gain
    told = [replace(c, left_over=left) if _has_a_form(c) else c for c in found.causes]
    for k, c in enumerate(told):
        told[k] = _recognised(likeness, c, told)
    return replace(found, causes=tuple(told))


def _acts_throughout(term: CandidateTerm) -> bool:
    return _kernels_hold(term) and term.mechanism.kind == "missing_physics"


def _kernels_hold(term: CandidateTerm) -> bool:
    """Whether a name's kernel holds such a force: it is of what acts throughout, and knows no places."""
    return not (term.variant.acts_in_windows or term.variant.comes_again)


def _has_a_likeness(c: Cause) -> bool:
    return c.needed is None and (c.term is None or _kernels_hold(c.term))


def _has_a_form(c: Cause) -> bool:
    """Whether it is a parameter or a law in the library's own form: a curve of its own, or a size for every
    recording, leaves nothing over of other laws too."""
    return not c.other_form and (c.term is None or (c.term.variant.is_a_law and not c.time_varying))


def _recognised(likeness: Likeness, c: Cause, causes: Sequence[Cause]) -> Cause:
    """One of the causes with its likeness."""
    if not _has_a_likeness(c):
        return c
    wrong = c.kind == "parameter_error"  # beside laws every parameter is free anyway
    others = {o.acts_as for o in causes if o is not c and (wrong or o.term is not None)} - {c.effect, UNKNOWN}
    names = likeness.of(c.force, others, c.term)
    more = 1.0 - names.pop(NOTHING, 0.0)
    if not names:
        return c
    same = {c.effect, *(name for name, worse in c.rivals if worse <= ALIKE * c.gain and name in names)}
    same -= {UNKNOWN}  # which is any force
    names |= dict.fromkeys(same, float(np.mean([names.get(name, 0.0) for name in same or [UNKNOWN]])))
    told = replace(c, likeness=tuple((name, p / more) for name, p in names.items()))
    likest = max(told.likeness, key=lambda item: item[1])[0]
    best = UNKNOWN if likest == UNKNOWN else next(iter(told.names))
    if not _may_be_called(c, best) or any(o.effect == best for o in causes):
        return told  # a name is one finding
    nearest = c.effect if c.term is not None else None  # its term stays, as the nearest there is
    return replace(told, effect=best, nearest=nearest, found_as=None if best == UNKNOWN else c.effect)


def _may_be_called(c: Cause, name: str) -> bool:
    """Whether what was found by its form may be told by another name: one of its kind, and of no force whose
    course is its own."""
    if name == UNKNOWN:
        return c.kind == "missing_physics"
    return not c.time_varying and name in LIBRARY and LIBRARY[name].kind == c.kind
