"""What was found: causes with their names, the probability of each, and the whole explanation."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from deeptruck_model.mismatch.mechanisms import CandidateTerm
from deeptruck_model.mismatch.posterior.free_law import FreeModel
from deeptruck_model.mismatch.posterior.left_out import LeftOut
from deeptruck_model.mismatch.posterior.road_lock import RoadLock
from deeptruck_model.mismatch.posterior.search import Model
from deeptruck_model.mismatch.rules import Rules

Array = NDArray[np.float64]

MOST_LOG = 30.0  # of the odds of a name against the one that was told
LIKENESS = 0.75  # share in the pool of a law that strays; from 0.7 to 0.9 alike on development cases


@dataclass(frozen=True)
class Cause:
    """One accepted cause: a mechanism (with its term), a parameter, or what no name explains (`unknown`)."""

    kind: str
    effect: str
    gain: float
    share: float
    force: Array  # specific force it adds to the simulator, (n,), m/s^2
    term: CandidateTerm | None = None
    rivals: tuple[tuple[str, float], ...] = ()  # other names and by how many nats they are worse
    nearest: str | None = None  # the name that is nearest by forms, where it is told by none or another
    found_as: str | None = None  # the name it was found by, where its likeness tells another
    needed: dict[str, float] | None = None  # for a slow force: the size each possible name would need
    alternatives: tuple[tuple[str, Model], ...] = ()  # whole explanations with rivals in its place
    whole: Model | None = None  # the explanation these stand beside, where it is not the final one
    road: RoadLock | None = None  # where the force came again on the same stretch of road
    other_form: bool = False  # it acts by its own signals, but otherwise than the library's form
    time_varying: bool = False  # an unknown force that is time-varying, and not one that the signals predict
    reported: bool | None = None  # whether the engine's recorded torque shows it, where that is known
    left_out: LeftOut | None = None  # what blocks left out of its own drives show, where no other drive can
    likeness: tuple[tuple[str, float], ...] = ()  # names, and the probability that the recogniser gives each
    left_over: float = np.inf  # nats that are left over beside a form that has no course of its own
    rules: Rules = field(default_factory=Rules)  # by which it is distinguishable from others

    @property
    def acts_as(self) -> str:
        """The name whose form it has: its own, or the nearest of what is told otherwise."""
        return self.term.mechanism.effect if self.term is not None else self.effect

    @property
    def predictable(self) -> bool:
        """Whether no name's forms have it, but the signals predict it: it has laws over them, and perhaps a
        formula."""
        formless = (self.found_as or self.effect) == "unknown" and self.term is None
        return formless and not self.time_varying and self.needed is None

    @property
    def names(self) -> dict[str, float]:
        """The probability of each name in its place, given that it is one of these; most probable first: by
        what its force is like and by forms (a linear pool), or by these alone where that is not known."""
        if not self.likeness:
            return self.by_forms
        share = LIKENESS * self._strays  # the recogniser learned from laws that stray
        pooled = {name: (1.0 - share) * p for name, p in self.by_forms.items()}
        for name, p in self.likeness:
            pooled[name] = pooled.get(name, 0.0) + share * p
        return _most_probable_first(pooled, self.effect)

    @property
    def by_forms(self) -> dict[str, float]:
        """The same by the best candidate term of each name alone.

        No law is exactly of the library's form, and how far it strays grows with its size: evidence is
        divided by a share of all that was gained (a coarsened posterior: Miller and Dunson, Journal of the
        American Statistical Association 114, 2019), so that more data alone decides nothing; by less where
        little is left over.
        """
        scale = max(self.rules.temper, self._form_error)
        worse = dict(reversed(self.rivals))
        worse |= {"unknown": 0.0} if self.other_form else {}
        worse[self.found_as or self.effect] = 0.0
        weight = {name: float(np.exp(min(-x / scale, MOST_LOG))) for name, x in worse.items()}
        nothing = float(np.exp(-self.gain / scale)) if self.gain > 0.0 else 0.0
        total = nothing + sum(weight.values())
        return _most_probable_first({name: w / total for name, w in weight.items()}, self.effect)

    @property
    def _form_error(self) -> float:
        """Nats by which its form may be off: between what forms of laws mostly are off by and, where that is
        less, what is left over (their geometric mean, as laws without a name see but a part of it; and less
        than `least_gain` is not seen)."""
        mostly = self.rules.coarse * max(self.gain, 0.0)
        return float(np.sqrt(mostly * min(mostly, max(self.left_over, self.rules.least_gain))))

    @property
    def _strays(self) -> float:
        """How much of what may speak against its form is the form's own error: little where noise is more, or
        where it is as exact as few laws are."""
        return self._form_error / max(self.rules.temper, self.rules.coarse * self.gain)

    @property
    def believed(self) -> float:
        """The probability that is told. By forms alone, a law that nobody here has read may be none of the
        names; the recogniser knows that."""
        fitted = self.names.get(self.effect, 0.0)
        by_forms = self.kind == "missing_physics" and not self.likeness
        return fitted * self.rules.recognised if by_forms else fitted

    @property
    def not_told_from(self) -> list[str]:
        """The other names of the smallest set that holds the right one with probability `credible`."""
        names = self.names
        before = np.cumsum([0.0, *names.values()])[:-1]
        kept = [
            name for name, sum_before in zip(names, before, strict=True) if sum_before < self.rules.credible
        ]
        return [name for name in kept if name != self.effect]


def _most_probable_first(names: dict[str, float], told: str) -> dict[str, float]:
    order = sorted(names, key=lambda name: (-names[name], name != told))
    return {name: names[name] for name in order}


@dataclass(frozen=True)
class Explanation:
    """Everything found on one body of evidence."""

    causes: tuple[Cause, ...]
    model: Model
    parameters_only: Model
    null: Model
    left_over: FreeModel
    left_over_gain: float
    lawful: Model | None  # with laws without a name beside it, where these explain what is left over
    ranking: tuple[tuple[str, float], ...]  # names tried beside the first cause; gain over parameters alone

    @property
    def gained(self) -> float:
        """Nats that all names together explain beyond parameters alone."""
        return self.model.score - self.parameters_only.score if self.model.named else 0.0
