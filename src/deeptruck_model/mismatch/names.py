"""Names read from the posterior: accepted names, their families, and sets of names that act together."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.special import softmax

from deeptruck_model._io.json_data import stored
from deeptruck_model.mismatch.posterior.events import Event, together
from deeptruck_model.mismatch.posterior.kernels import VARYING, kernels
from deeptruck_model.mismatch.posterior.posterior import NO_NAME, Posterior, gains
from deeptruck_model.mismatch.rules import Limits
from deeptruck_model.mismatch.tree import FAMILY, Tree

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

MOST_EXPLANATIONS = 6


@dataclass(frozen=True)
class Named:
    """One effect in the posterior: its most probable `name`, the `tree` of alternatives, the gain (`nats`) of
    its kernel, and the posterior mean (n,) of its force, m/s^2. It is a finding only if `accepted`. A
    `brief` one acts in events only."""

    name: str
    tree: Tree
    nats: float
    force: Array
    accepted: bool = True
    brief: bool = False


@dataclass(frozen=True)
class Explanation:
    """A set of names, and the probability that exactly these act."""

    names: tuple[str, ...]
    probability: float = field(metadata=stored(digits=3))


@dataclass(frozen=True)
class Names:
    """The effects, most probable first; the sets of names that act together; and the probability of every
    name."""

    found: tuple[Named, ...]
    explanations: tuple[Explanation, ...]
    each: Mapping[str, float]


def names(p: Posterior, happened: Sequence[Event] = ()) -> Names:
    """The names of a posterior. Each has the most probable name of the most probable family in the draws that
    earlier ones leave open, if that family acts with a probability of `rules.named`; for the first it
    suffices that any mechanism does. Its alternatives are the names that may act in its place. Without any
    accepted, it is the possible common cause of the events that `happened`."""
    rules = p.search.rules
    there = {n: p.inside(n) for n in dict.fromkeys(k.name for k in p.of)}
    own = {n: x for n, x in there.items() if n not in NO_NAME}
    some = float(np.any(list(own.values()), axis=0).mean()) if own else 0.0
    left = {n: x for n, x in own.items() if x.mean() >= Limits.rare}
    found: list[Named] = []
    for _ in range(rules.most_findings):
        family, probability = _most_probable(left)
        if not left or (probability < rules.named and (found or some < rules.named)):
            break
        name = max((n for n in left if FAMILY[n] == family), key=lambda n: left[n].mean())
        chosen, probable = p.in_place_of(name, [x.name for x in found])
        left = _without(left, name, chosen)
        tree = Tree({n: q * probable for n, q in chosen.items() if q * probable >= Limits.rare})
        if sum(tree.names.values()) >= rules.named:
            found.append(_named(p, name, tree))
            left.pop(found[-1].name, None)
    matters = max((abs(x.speed_change) for x in happened), default=0.0) >= rules.drift
    if matters and len(happened) >= Limits.events_agree and not any(x.accepted for x in found):
        found = [_cause(p, happened)]
    each = {n: float(x.mean()) for n, x in own.items() if x.mean() >= Limits.rare}
    return Names(tuple(found), _explanations(own), each)


def _named(p: Posterior, sought: str, tree: Tree) -> Named:
    """The finding in the place of the name `sought`, whose force it has: in its place others were drawn too
    seldom to know theirs."""
    first = tree.first
    sure = sum(tree.names.values()) >= p.search.rules.stated  # a learned simulator is off in many ways
    accepted = (sure or p.search.e.known_physics) and p.gain(first) > _own_gain(p)
    return Named(first, tree, p.gain(first), p.force(sought, p.inside(sought)), accepted)


def _cause(p: Posterior, happened: Sequence[Event]) -> Named:
    """What may be the one cause of some events, of which noise makes hardly two. Names that do not vary in
    time of themselves are less probable by the odds of that. No form is exact here either, see
    `Posterior.in_place_of`."""
    nats, force = together(p, happened)
    unit = max(Limits.form_choice * max(nats.values()), p.search.rules.evidence_temperature)
    varies = {k.name for k in kernels(p.search) if k.part == VARYING}
    odds = [0.0 if n in varies else np.log(Limits.not_always) for n in nats]
    chosen = softmax(np.array([*nats.values()]) / unit + odds)
    tree = Tree({n: float(q) for n, q in zip(nats, chosen, strict=True) if q >= Limits.rare})
    return Named(tree.first, tree, nats[tree.first], force, p.search.e.known_physics, brief=True)


def _own_gain(p: Posterior) -> float:
    """The gain that a name must exceed for a learned simulator, nats: the largest gain of any name, scaled to
    as much driving, on the simulator's own held-out recordings."""
    own = p.search.own
    if own is None:
        return 0.0
    ratio = max(float(p.search.e.valid.sum()) / max(float(own.e.valid.sum()), 1.0), Limits.least_ratio)
    return p.search.rules.discrepancy * ratio * max(gains(own).values())


def _most_probable(left: Mapping[str, Mask]) -> tuple[str, float]:
    families: dict[str, Mask] = {}
    for n, x in left.items():
        families[FAMILY[n]] = families.get(FAMILY[n], np.zeros_like(x)) | x
    best = max(families, key=lambda f: families[f].mean(), default="")
    return best, float(families[best].mean()) if families else 0.0


def _without(left: Mapping[str, Mask], name: str, chosen: Mapping[str, float]) -> dict[str, Mask]:
    """For each name the draws (m,) in which it acts: all without the given one, and those without it in which
    the name most probably `chosen` in its place is left out too."""
    out = dict(left)
    open_ = ~out.pop(name)
    for n in sorted((n for n in out if chosen.get(n, 0.0) >= Limits.rare), key=lambda n: -chosen[n]):
        out[n], open_ = out[n] & ~open_, open_ & ~out[n]
    return {n: x for n, x in out.items() if x.mean() >= Limits.rare}


def _explanations(own: Mapping[str, Mask]) -> tuple[Explanation, ...]:
    order = sorted(own)
    count = len(next(iter(own.values()))) if own else 0
    sets = Counter(
        tuple(n for n, x in zip(order, row, strict=True) if x) for row in np.array([own[n] for n in order]).T
    )
    return tuple(Explanation(s, k / count) for s, k in sets.most_common(MOST_EXPLANATIONS))
