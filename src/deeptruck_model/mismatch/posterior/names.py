"""Names read from the draws: accepted names, the names that act in their place, and sets of names."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cache

import numpy as np

from deeptruck_core.arrays import Array, Mask
from deeptruck_core.json_data import stored
from deeptruck_model.mismatch.mechanisms.families import FAMILY, ROOT, UNKNOWN
from deeptruck_model.mismatch.posterior.budget import Budget
from deeptruck_model.mismatch.posterior.events import Event, rows_of
from deeptruck_model.mismatch.posterior.posterior import NO_NAME, Posterior, gains
from deeptruck_model.mismatch.posterior.regression import Regression
from deeptruck_model.mismatch.prepare.drives import PreparedDrives
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.rules import Limits

MOST_EXPLANATIONS = 6


@dataclass(frozen=True)
class Node:
    """A node of the tree: a family below the root, or a name below its family. `probability`: that a name
    acts, or any of a family."""

    node: str
    parent: str
    probability: float


@dataclass(frozen=True)
class Tree:
    """The probability of every name, and of each family: that any of its names acts. Where `of_families` is
    empty, names exclude each other, and a family's probability is the sum over its names."""

    names: Mapping[str, float]
    of_families: Mapping[str, float] = field(default_factory=dict)

    @property
    def families(self) -> dict[str, float]:
        """The probability that any name of a family acts, most probable first."""
        each = dict(self.of_families)
        for name, p in self.names.items() if not each else ():
            each[FAMILY[name]] = each.get(FAMILY[name], 0.0) + p
        return dict(sorted(each.items(), key=lambda item: -item[1]))

    @property
    def first(self) -> str:
        """The most probable name in the most probable family."""
        return max(self.of(next(iter(self.families))).items(), key=lambda item: item[1])[0]

    def of(self, family: str) -> dict[str, float]:
        """The names of a family, most probable first."""
        own = {name: p for name, p in self.names.items() if FAMILY[name] == family}
        return dict(sorted(own.items(), key=lambda item: -item[1]))

    def credible(self, mass: float) -> tuple[str, ...]:
        """The smallest set of names whose probabilities sum to `mass` of the total, most probable first."""
        out, total = [], 0.0
        mass = mass * sum(self.names.values())
        for name, p in sorted(self.names.items(), key=lambda item: -item[1]):
            if total >= mass:
                break
            out.append(name)
            total += p
        return tuple(out)

    def stated(self, least: float) -> str:
        """The deepest node with at least this probability."""
        best = max(self.names.items(), key=lambda item: item[1])
        if best[1] >= least:
            return best[0]
        family, p = next(iter(self.families.items()))
        return family if p >= least else ROOT

    def nodes(self) -> tuple[Node, ...]:
        """The root's children and their children, most probable first."""
        out = []
        for family, p in self.families.items():
            out.append(Node(family, ROOT, p))
            if family != UNKNOWN:
                out += [Node(name, family, own) for name, own in self.of(family).items()]
        return tuple(out)


@dataclass(frozen=True)
class Named:
    """One effect in the posterior: its most probable `name`; the probabilities (`tree`) of it and of the
    names that act in its place; the gain (`nats`) of its kernel; and the mean (n,) of its force, m/s^2, over
    the `given` draws (m,). It is a finding only if `accepted`."""

    name: str
    tree: Tree
    nats: float
    force: Array
    accepted: bool = True
    given: Mask = field(default_factory=lambda: np.zeros(0, dtype=bool))
    lasts: bool = True  # else it acts in events alone


@dataclass(frozen=True)
class Explanation:
    """A set of names, and the probability that exactly these act."""

    names: tuple[str, ...]
    probability: float = field(metadata=stored(digits=3))


@dataclass(frozen=True)
class Names:
    """The effects, most probable first; the sets of names that act together; and the probabilities of all
    names (`tree`), with that of none."""

    found: tuple[Named, ...]
    explanations: tuple[Explanation, ...]
    tree: Tree
    nothing: float
    given: Mask | None = None  # draws (m,) from which forces and shares are read; None: all of them


def names(p: Posterior) -> Names:
    """The names of a posterior, each with its probability in the draws: first those that are probable enough
    to be stated, by the speed error that their forces add up to, then the others by their probability.

    A name stands for those that act in its place: the ones that are in more often without it than with it.
    It is an effect if the probability that any of one family of these acts is `rules.named` or more: many
    names of which none is probable are none.
    """
    rules = p.regression.rules
    acts = {n: p.inside(n) for n in dict.fromkeys(k.name for k in p.of) if n not in NO_NAME}
    left = {n: x for n, x in acts.items() if x.mean() >= Limits.rare}
    whole = tree_of(left)
    found: list[Named] = []
    size = cache(lambda n: _speed_error(p, p.force(n, p.inside(n))))
    while left and len(found) < rules.most_findings:
        likely = {n: min(float(x.mean()), rules.stated) for n, x in left.items()}
        first = [n for n, chance in likely.items() if chance == max(likely.values())]
        name = max(first, key=size) if len(first) > 1 else first[0]
        there = left[name]
        place = {n: x for n, x in left.items() if n == name or (x & ~there).sum() > (x & there).sum()}
        left = {n: x for n, x in left.items() if n not in place}
        tree = tree_of(place)
        if max(tree.families.values()) >= rules.named:
            found.append(_named(p, name, tree))
    none = float((~np.any(list(acts.values()), axis=0)).mean()) if acts else 1.0
    accepted = [f.name for f in found if f.accepted]
    together = np.all([p.inside(n) for n in accepted], axis=0) if accepted else np.zeros(0, dtype=bool)
    if not accepted or together.mean() < Limits.least_in:
        return Names(tuple(found), _explanations(acts), whole, none)
    for k, f in enumerate(found):  # in the draws of all, so that their forces add up to one explanation
        if f.accepted:
            found[k] = replace(f, force=p.force(f.name, together), given=together)
    return Names(tuple(found), _explanations(acts), whole, none, together)


def tree_of(acts: Mapping[str, Mask]) -> Tree:
    """The probabilities of names from the draws (m,) in which each acts, and of any in each family."""
    families: dict[str, Mask] = {}
    for n, x in acts.items():
        families[FAMILY[n]] = families.get(FAMILY[n], np.zeros_like(x)) | x
    return Tree(
        {n: float(x.mean()) for n, x in acts.items()},
        {family: float(x.mean()) for family, x in families.items()},
    )


def _named(p: Posterior, name: str, tree: Tree) -> Named:
    """A name; accepted if its force adds up to more than the noise of ordinary sensors, and a delay is longer
    than theirs. For a learned simulator a name is accepted only from probability `stated` on, and with more
    gain than any name has on the simulator's own recordings."""
    acts, force = p.inside(name), p.force(name, p.inside(name))
    lasts = bool(p.lasts(name).sum() >= 0.5 * acts.sum())
    sure = max(tree.families.values()) >= p.regression.rules.stated
    accepted = p.regression.e.known_physics or (sure and p.gain(name) > _reference_gain(p))
    accepted = accepted and _speed_error(p, force) >= Limits.adds_up and _longer_than_sensors(p, name, force)
    return Named(name, tree, p.gain(name), force, accepted, acts, lasts)


def _speed_error(p: Posterior, force: Array) -> float:
    """Speed error (rms, m/s) that a force (n,) adds up to within those of the longest free runs in which it
    acts: what acts for seconds in an hour is not small for that."""
    return p.regression.e.everywhere().adds_up(force, Limits.horizons_s[0], where_it_acts=True)


def _longer_than_sensors(p: Posterior, name: str, force: Array) -> bool:
    """Whether a delay exceeds that of ordinary message periods and filters. The nuisance terms of sensors
    take up part of a delay, so that the whole residual is compared, where the force acts."""
    e = p.regression.e
    if not any(m.effect == name and m.delay for m in p.regression.library):
        return True
    rows = e.valid & (force != 0.0)
    late = e.rerun("delay_all", e.rules.least_delay_s)[rows]
    times = abs(float(e.residual[rows] @ late)) / max(float(late @ late), 1e-12)
    return times > 1.0


def _reference_gain(p: Posterior) -> float:
    """The gain that a name must exceed for a learned simulator, nats: the largest gain of any name, scaled to
    as much driving, on the simulator's own held-out recordings."""
    reference = p.regression.reference
    if reference is None:
        return 0.0
    ratio = max(
        float(p.regression.e.valid.sum()) / max(float(reference.e.valid.sum()), 1.0), Limits.least_ratio
    )
    return p.regression.rules.discrepancy * ratio * max(gains(reference).values())


def _explanations(acts: Mapping[str, Mask]) -> tuple[Explanation, ...]:
    order = sorted(acts)
    count = len(next(iter(acts.values()))) if acts else 0
    sets = Counter(
        tuple(n for n, x in zip(order, row, strict=True) if x) for row in np.array([acts[n] for n in order]).T
    )
    return tuple(Explanation(s, k / count) for s, k in sets.most_common(MOST_EXPLANATIONS))


@dataclass(frozen=True)
class Compared:
    """A comparison: the simulator's own `parameters`, the drives, the evidence of the simulator as given, the
    posterior (perhaps linearised at estimated parameters), names, budget, events, and remarks (`caveats`)."""

    parameters: Mapping[str, float]
    drives: PreparedDrives
    given: Evidence
    posterior: Posterior
    names: Names
    budget: Budget
    events: tuple[Event, ...] = ()
    caveats: tuple[str, ...] = ()

    @property
    def regression(self) -> Regression:
        """The regression on which all names are compared."""
        return self.posterior.regression

    @property
    def share_compared(self) -> float:
        """The share of rows that are compared, in fitted and held-out drives."""
        return float(self.regression.e.everywhere().valid.mean())

    @property
    def fitted(self) -> Evidence:
        """The evidence of the fitted drives, with what their fit leaves out because it acts for seconds."""
        e = self.regression.e
        rows = rows_of(self.events, len(e))
        return replace(e, valid=e.valid | (rows & e.everywhere().valid & ~e.held_out))
