"""The variants of a candidate term: when it acts, and whether its size is one throughout.

What enters a mechanism's formula nonlinearly (time constants, thresholds, orders) are its `Constants`, a
frozen dataclass beside each formula. Four variants say where a coefficient applies: `Static` always,
`FromMoment` from a moment on, `PerRecording` in one recording each, `Spline` at knots in time or distance.
`OwnCurve` is a curve through a few knots over a variable. `Sum` is made of variants.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from typing import Literal

MANY_TERMS = 20.0  # trials of a spline: it can stand in for much else, and is penalised for that
CURVE_TRIALS = 3.0  # a curve of its own is one of so many terms more in which its mechanism is looked for


@dataclass(frozen=True)
class Constants:
    """What enters a formula nonlinearly; this one: nothing."""

    def numbers(self) -> Iterator[tuple[str, float]]:
        """Name and value of each constant that is a float."""
        for f in fields(self):
            value = getattr(self, f.name)
            if isinstance(value, float):
                yield f.name, value


NONE = Constants()


class Variant(ABC):
    """What all variants can be asked."""

    @property
    @abstractmethod
    def leaves(self) -> tuple[Simple, ...]:
        """The summands that are no sum."""

    @property
    def parts(self) -> tuple[Variant, ...]:
        """The summands; a variant that is no sum is its only one."""
        return (self,)

    @property
    def constants(self) -> Constants:
        """Of the formula; none for a sum and a curve of its own."""
        return NONE

    @property
    def trials(self) -> float:
        """How many alternatives it was picked from."""
        return 1.0

    @property
    def varies_in_time(self) -> bool:
        """Whether it has knots in time or along the road, and so can follow any slow force."""
        return any(leaf.varies_in_time for leaf in self.leaves)

    def steady(self) -> Variant:
        """The same without knots: one size throughout. A sum stays as it is."""
        return self

    def numbers(self) -> Iterator[tuple[str, float]]:
        """Name and value of each constant that is a float, of all summands."""
        for leaf in self.leaves:
            yield from leaf.numbers()


class Simple(Variant):
    """A variant that is not made of others."""

    @property
    def leaves(self) -> tuple[Simple, ...]:
        return (self,)

    @property
    def varies_in_time(self) -> bool:
        return False

    def numbers(self) -> Iterator[tuple[str, float]]:
        yield from self.constants.numbers()


@dataclass(frozen=True)
class Static(Simple):
    """One coefficient for each column, on every drive."""

    constants: Constants = NONE


@dataclass(frozen=True)
class FromMoment(Simple):
    """Zero before `after_s` (s) in recording `first` of `count`, full from then on; one of so many `moments`
    that are tried. A simulation of another drive always has it."""

    first: int
    after_s: float
    count: int
    moments: int
    constants: Constants = NONE

    @property
    def trials(self) -> float:
        return float(self.moments)

    def numbers(self) -> Iterator[tuple[str, float]]:
        yield from super().numbers()
        yield "after_s", self.after_s


@dataclass(frozen=True)
class PerRecording(Simple):
    """A coefficient for each of the recordings `names`; a simulation of another drive has the share `mean` of
    each. `weather` is from outside the truck: of its size other drives say nothing."""

    names: tuple[str, ...]
    mean: float
    constants: Constants = NONE
    weather: bool = False


@dataclass(frozen=True)
class Spline(Simple):
    """A linear spline with knots every `spacing` along `along` (s, or m), `knots` of them in each recording.

    A `shared` one has the same knots for all recordings, at places along the road. `sd` is the prior sd of a
    coefficient. With `levels` each recording also has a coefficient of its own. A simulation of another drive
    has the share `mean` of every knot. Without knots one coefficient holds throughout.
    """

    along: Literal["elapsed", "distance"]
    knots: tuple[int, ...]
    names: tuple[str, ...]
    spacing: float
    mean: float
    sd: float
    shared: bool = False
    levels: bool = False
    constants: Constants = NONE

    @property
    def trials(self) -> float:
        return MANY_TERMS if self.knots else 1.0

    @property
    def varies_in_time(self) -> bool:
        return bool(self.knots)

    def steady(self) -> Variant:
        return replace(self, knots=())


@dataclass(frozen=True)
class OwnCurve(Simple):
    """The curve number `index` of its mechanism in `own_forms.OWN`, with knots `at`; `scale` is the carrier's
    rms, or one."""

    index: int
    at: tuple[float, ...]
    scale: float

    @property
    def trials(self) -> float:
        return CURVE_TRIALS


@dataclass(frozen=True)
class Sum(Variant):
    """Variants of one mechanism side by side: its true form may lie between two of them."""

    summands: tuple[Variant, ...]

    @property
    def parts(self) -> tuple[Variant, ...]:
        return self.summands

    @property
    def leaves(self) -> tuple[Simple, ...]:
        return tuple(leaf for part in self.summands for leaf in part.leaves)
