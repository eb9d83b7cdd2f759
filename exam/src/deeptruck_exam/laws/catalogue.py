"""The catalogue of laws, and the decorators that register a law in it.

A law is declared by `law` (a class of force or command filter, or a function that returns a Planted) or by
`fault` (a function that corrupts recorded channels), with `sizes` below it: the ranges from which its sizes
are drawn. Its key is its own name in snake case. The docstring describes the law and, after `Source:`, names
the source of its equation.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any, Literal, TypeVar

import numpy as np

from deeptruck_exam.laws.law import Channels, CommandLaw, Law, Setting, Sizes
from deeptruck_model.trucks import CommandFilter, Force

Kind = Literal["missing_physics", "measurement_fault", "parameter_error"]
Fault = Callable[[Channels, float, np.random.Generator], None]
"""Spoils the recorded channels of one recording in place; the second argument is dt."""

DRIVES = ("highway", "suburban", "hills", "descent")
EVERYWHERE = " ".join(DRIVES)
POOL = "freightliner trucksim volvo"
SIGN = (-1.0, 1.0)
UNKNOWN = "unknown"


@dataclass(frozen=True)
class Planted:
    """Difference between the true truck or its recording and the simulator."""

    forces: tuple[Force, ...] = ()
    filters: tuple[CommandFilter, ...] = ()
    parameters: Mapping[str, float] = field(default_factory=dict)
    faults: tuple[Fault, ...] = ()
    withheld: tuple[str, ...] = ()


@dataclass(frozen=True)
class Effect:
    """A law that a case can hide.

    `name` is the right answer, `key` distinguishes laws of one name. `ranges` are (low, high) by size, drawn
    uniformly. `accepts` are names that recordings alone cannot distinguish from it, counted as right only
    inside a stated set. `drives` are the kinds of drive in which it acts, `trucks` the trucks that can have
    it; `leader` says whether it needs one, `gateable` whether it can be restricted to a driving condition.
    """

    key: str
    name: str
    kind: Kind
    source: str
    ranges: Mapping[str, tuple[float, float]]
    build: Callable[[Setting, Sizes], Planted]
    drives: tuple[str, ...] = DRIVES
    trucks: tuple[str, ...] = tuple(POOL.split())
    accepts: tuple[str, ...] = ()
    leader: bool = False
    gateable: bool = False

    def draw(self, rng: np.random.Generator, scale: float = 1.0) -> dict[str, float]:
        """Random sizes. `scale` shifts the draw towards the upper end of the ranges (1: uniform)."""
        return {
            n: float(lo + (hi - lo) * rng.random() ** (1.0 / scale)) for n, (lo, hi) in self.ranges.items()
        }


EFFECTS: dict[str, Effect] = {}
_SIZES: dict[Any, dict[str, tuple[float, float]]] = {}
Declared = TypeVar("Declared", bound=Callable[..., Any])


def sizes(**ranges: tuple[float, float]) -> Callable[[Declared], Declared]:
    """The ranges of a law's sizes, by name."""

    def add(declared: Declared) -> Declared:
        _SIZES[declared] = ranges
        return declared

    return add


def register(effect: Effect) -> None:
    if effect.key in EFFECTS:
        raise ValueError(f"law '{effect.key}' is registered twice")
    EFFECTS[effect.key] = effect


def law(
    name: str,
    drives: str = EVERYWHERE,
    *,
    accepts: str = "",
    trucks: str = POOL,
    leader: bool = False,
    gateable: bool = True,
    reported: bool = False,
) -> Callable[[Declared], Declared]:
    """Register a Law, a CommandLaw or a function (setting, p) -> Planted; only a Law can be gated by a
    condition."""

    def add(declared: Declared) -> Declared:
        is_force = isinstance(declared, type) and issubclass(declared, Law)
        if isinstance(declared, type) and issubclass(declared, Law):
            declared.reported = reported
        more = {"leader": leader, "gateable": gateable and is_force}
        build = partial(_planted, declared) if isinstance(declared, type) else declared
        _enter(declared, build, name, "missing_physics", drives, accepts, trucks, **more)
        return declared

    return add


def fault(
    name: str, drives: str = EVERYWHERE, *, accepts: str = "", withheld: str = ""
) -> Callable[[Declared], Declared]:
    """Register a function (p, channels, dt, rng) that corrupts one recording's channels in place."""

    def add(spoil: Declared) -> Declared:
        def build(setting: Setting, p: Sizes) -> Planted:
            return Planted(faults=(partial(spoil, p),), withheld=tuple(withheld.split()))

        _enter(spoil, build, name, "measurement_fault", drives, accepts, POOL)
        return spoil

    return add


def _planted(part: Any, setting: Setting, p: Sizes) -> Planted:
    if issubclass(part, CommandLaw):
        return Planted(filters=(part(setting, p),))
    return Planted(forces=(part(setting, p),), withheld=part.withheld)


def _enter(
    declared: Any, build: Any, name: str, kind: Kind, drives: str, accepts: str, trucks: str, **more: Any
) -> None:
    key = re.sub(r"(?<=[a-z])(?=[A-Z])", "_", declared.__name__).lower()
    source = " ".join((declared.__doc__ or "").partition("Source:")[2].split())
    ranges = _SIZES.get(declared, {})
    where, alike, which = (tuple(text.split()) for text in (drives, accepts, trucks))
    register(Effect(key, name, kind, source, ranges, build, where, which, alike, **more))
