"""The tree of names: families of mechanisms, the names in each, and `unknown`; and the parts of the budget,
which are the families and the nonparametric terms.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import get_args

from deeptruck_core.errors import InputError
from deeptruck_model.mismatch.mechanisms import LIBRARY, Mechanism
from deeptruck_model.mismatch.mechanisms.others import PARAMETER_ERRORS, SENSOR_ERRORS
from deeptruck_model.mismatch.mechanisms.record import Family

ROOT = "mismatch"
UNKNOWN = "unknown"
FAMILIES = get_args(Family)
FAMILY: dict[str, str] = {
    **{s.name: s.family for s in SENSOR_ERRORS.values()},
    **{p.name: p.family for p in PARAMETER_ERRORS.values()},
    **{m.effect: m.family for m in LIBRARY.values()},
}
NAMES = {family: tuple(sorted(name for name in FAMILY if FAMILY[name] == family)) for family in FAMILIES}
FAMILY[UNKNOWN] = UNKNOWN


def joined(mechanisms: Sequence[Mechanism]) -> None:
    """Let the user's mechanisms be found, in the library and in the tree. Raises InputError for a name that
    the tool has."""
    for m in mechanisms:
        if m.effect in FAMILY and m.effect not in LIBRARY.own:
            raise InputError(f"'{m.effect}' is a name of the tool; choose another one for the mechanism")
    for m in mechanisms:
        LIBRARY.own[m.effect], FAMILY[m.effect] = m, m.family


LEFT_OVER, EACH_DRIVE, SLOW, PLACE = "left_over", "each_drive", "slow", "place"
SENSORS = "sensors"
HIDDEN = "unrecorded:brake"
PARTS = (*NAMES, PLACE, EACH_DRIVE, SLOW, HIDDEN, UNKNOWN, LEFT_OVER)  # of the budget


@dataclass(frozen=True)
class Node:
    """A node of the tree: a family below the root, or a name below its family. `probability`: that a name
    acts, or any of a family."""

    node: str
    parent: str
    probability: float


@dataclass(frozen=True)
class Tree:
    """The probability of every name, and of any name of a family: of names that may act together it is less
    than their sum, which it is where `of_families` is empty."""

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
