"""The record of a mechanism, which describes a physical effect by its dependences and not by a single
formula.

A record states the signals that drive it, the direction in which it can act, and how large it can be. Its
forms have constants (time constants, thresholds, orders: all nonlinear parameters), each tried at several
values. Forms are selected by evidence, coefficients are fitted. `terms.py` evaluates all records.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from deeptruck_model.mismatch.mechanisms.courses import ALWAYS, Course, Offer, always
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.residual.expression import Expression

Constants = Mapping[str, Any]
Family = Literal["sensors", "timing", "brakes", "engine_driveline", "air_tyres_road", "load"]

Trend = Literal["rising", "falling", "any"]

EVEN = (0.02, 0.35, 0.65, 0.98)


@dataclass(frozen=True)
class Column:
    """One coefficient: its regressor, its prior, and how it is reported (unit and conversion factor)."""

    expression: Expression
    sd: float
    name: str
    unit: str = "1"
    factor: float = 1.0
    per_mass: bool = False  # the coefficient times the mass (kg) is in `unit`
    sign: int = 1  # +1: never negative; 0: free
    mean: float = 0.0
    course: tuple[tuple[str, float], ...] = ()  # of a piece of a curve: what it adds at each place, by name
    most: float = np.inf  # the largest physically possible coefficient times factor: a size is stated within
    # the force of a coefficient, where it is not proportional to it and `expression` is about its share
    exact: Callable[[float], Expression] | None = None


def force(expression: Expression, sd: float, name: str = "force", sign: int = 1) -> Column:
    """A column whose coefficient is a force in N."""
    return Column(expression, sd, name, "N", per_mass=True, sign=sign)


@dataclass(frozen=True)
class Form:
    """A formula: `columns` (m/s^2 per unit coefficient) as a function of its constants.

    `constants` are the values to try, which may depend on the recordings. Those that are `fitted` start
    there, within physical limits (low, high), which are two standard deviations of a log-normal prior to
    either side of its median. `units` are those of the constants that a finding reports, `words` the
    permitted values of constants that are not numbers. `needs` are signals in addition to those of the
    mechanism. With knots, a constant coefficient is added if `steady`, and one for each drive, on the column
    `level`, if that is given.
    """

    columns: Callable[..., Column | list[Column]]
    constants: Iterable[Constants] | Callable[[Evidence], Iterable[Constants]] = ({},)
    courses: tuple[Offer, ...] = (always,)
    needs: tuple[str, ...] = ()
    units: Mapping[str, str] = field(default_factory=dict)
    words: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    steady: bool = True
    level: Callable[..., Column] | None = None
    fitted: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    def made(self, constants: Constants) -> list[Column]:
        """Its columns with a constant coefficient."""
        columns = self.columns(**constants)
        return columns if isinstance(columns, list) else [columns]

    def tried(self, e: Evidence) -> Iterator[tuple[Constants, Course]]:
        """Constants and courses that these recordings can show."""
        if e.has(*self.needs):
            for constants in self.constants(e) if callable(self.constants) else self.constants:
                for offer in self.courses:
                    for course in offer(e, self.made(constants)[0].expression):
                        yield constants, course


@dataclass(frozen=True)
class Curve:
    """A nonparametric form: `carrier` times a monotone or free curve over `of`, through a few knots.

    A monotone curve without `level` is zero at its low end. `share`: the carrier is a force, and the curve a
    share of it.
    """

    carrier: Expression
    of: Expression
    by: str
    trend: Trend
    level: bool = False
    share: bool = True
    sd: float = 0.3
    needs: tuple[str, ...] = ()
    knots: tuple[float, ...] = EVEN  # quantiles of `of` where the carrier acts


@dataclass(frozen=True)
class Variant:
    """A form by its name, with values of its constants and the course of its coefficient."""

    form: str
    constants: tuple[tuple[str, Any], ...] = ()
    course: Course = ALWAYS


def variant(form: str, course: Course = ALWAYS, **constants: Any) -> Variant:
    """A variant from the constants' names and values."""
    return Variant(form, tuple(constants.items()), course)


@dataclass(frozen=True)
class Mechanism:
    """A named physical effect.

    `needs` are the signals without which it cannot be tested; `depends_on` describes its dependences in
    words; `manoeuvre` would separate it from others; `prior` is its prior probability relative to the others.
    """

    effect: str
    family: Family
    says: str
    equation: str
    needs: tuple[str, ...]
    depends_on: tuple[str, ...]
    source: str
    manoeuvre: str
    forms: Mapping[str, Form | Curve] = field(repr=False)
    kind: str = "missing_physics"
    prior: float = 1.0
    prior_with: Mapping[str, float] = field(default_factory=dict, repr=False)  # factors, by recorded signals
    delay: bool = False  # a time, of which ordinary sensors and message periods make some
    of_input: str = ""  # the input whose error it is
    mistaken_for: str = ""  # the input that may explain the same force where it was not recorded

    def chance(self, e: Evidence) -> float:
        """Prior probability relative to the other mechanisms, given which signals were recorded."""
        return self.prior * math.prod(factor for name, factor in self.prior_with.items() if e.has(name))


def grid(**values: Iterable[Any]) -> tuple[Constants, ...]:
    """Every combination of constant values, the last constant varying fastest."""
    combinations = itertools.product(*values.values())
    return tuple(dict(zip(values, combination, strict=True)) for combination in combinations)
