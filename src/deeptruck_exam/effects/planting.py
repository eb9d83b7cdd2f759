"""What a hidden effect is, and how one is declared.

A law is declared by two decorators: `hidden` (or `fault`, `planted`; `law` for those of one file) gives its
key, its family, the drives in which it acts and the name that is the right answer; `sizes` the ranges its
sizes are drawn from. The docstring says what the law does and, after `Source:`, where it comes from.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any, Literal, TypeVar

import numpy as np

from deeptruck_exam.effects.law import Channels, Filter, Hidden, Setting, Sizes
from deeptruck_model.trucks import CommandFilter, Force

Kind = Literal["missing_physics", "measurement_fault", "parameter_error"]
Fault = Callable[[Channels, float, np.random.Generator], None]
"""Spoils the recorded channels of one recording in place; second argument is dt."""

SCENARIOS = ("highway", "suburban", "hills", "descent")
EVERYWHERE = " ".join(SCENARIOS)
POOL = "freightliner trucksim volvo"
FAMILIES = (
    "first",
    "second",
    "third",
    "fourth",
    "fifth",
    "sixth",
    "seventh",
    "eighth",
    "ninth",
    "tenth",
    "eleventh",
    "twelfth",
    "thirteenth",
    "fourteenth",
    "fifteenth",
    "sixteenth",
    "seventeenth",
    "eighteenth",
    "nineteenth",
    "twentieth",
    "twenty-first",
)
SEALED, ALL = "sealed", "all"  # the next family; those of FAMILIES together
FORMS = (ALL, *FAMILIES, SEALED)
SIGN = (-1.0, 1.0)


@dataclass(frozen=True)
class Planted:
    """What makes the true truck or its recording differ from what the simulator knows."""

    forces: tuple[Force, ...] = ()
    filters: tuple[CommandFilter, ...] = ()
    parameters: Mapping[str, float] = field(default_factory=dict)
    faults: tuple[Fault, ...] = ()
    conceal: tuple[str, ...] = ()


@dataclass(frozen=True)
class Effect:
    """`name` is the right answer, `key` distinguishes effects of one name, `family` is one of FAMILIES,
    `ranges` are (low, high) by name, drawn uniformly. `accepts` are names that recordings alone cannot
    distinguish from it, counted right only inside a stated group. `needs` are scenarios in which it acts,
    `trucks` the trucks that can have it."""

    key: str
    name: str
    kind: Kind
    family: str
    source: str
    ranges: Mapping[str, tuple[float, float]]
    build: Callable[[Setting, Sizes], Planted]
    needs: tuple[str, ...] = SCENARIOS
    trucks: tuple[str, ...] = tuple(POOL.split())
    accepts: tuple[str, ...] = ()
    leader: bool = False
    gateable: bool = False

    def draw(self, rng: np.random.Generator, scale: float = 1.0) -> dict[str, float]:
        """Random sizes. `scale` moves the draw towards the upper end of the ranges (1: uniform)."""
        return {
            n: float(lo + (hi - lo) * rng.random() ** (1.0 / scale)) for n, (lo, hi) in self.ranges.items()
        }


EFFECTS: dict[str, Effect] = {}
_SIZES: dict[Hashable, dict[str, tuple[float, float]]] = {}
Law = TypeVar("Law", bound=Hashable)
Part = TypeVar("Part", bound=type[Hidden] | type[Filter])
Spoil = TypeVar("Spoil", bound=Callable[..., None])
Build = TypeVar("Build", bound=Callable[[Setting, Sizes], Planted])


def sizes(**ranges: tuple[float, float]) -> Callable[[Law], Law]:
    """The ranges of a law's sizes, by name; in several lines where they are many."""

    def add(law: Law) -> Law:
        _SIZES[law] = {**ranges, **_SIZES.get(law, {})}
        return law

    return add


def register(effect: Effect) -> None:
    if effect.key in EFFECTS:
        raise ValueError(f"effect '{effect.key}' is registered twice")
    EFFECTS[effect.key] = effect


def _declare(law: Any, build: Callable[[Setting, Sizes], Planted], kind: Kind, **more: Any) -> None:
    """Register with the sizes of `law` and the source that its docstring states."""
    source = " ".join((law.__doc__ or "").partition("Source:")[2].split())
    for name, usual in (("needs", EVERYWHERE), ("accepts", ""), ("trucks", POOL)):
        more[name] = tuple(more.get(name, usual).split())
    register(Effect(kind=kind, source=source, ranges=_SIZES.get(law, {}), build=build, **more))


def hidden(
    key: str,
    family: str,
    needs: str = EVERYWHERE,
    *,
    name: str,
    accepts: str = "",
    trucks: str = POOL,
    leader: bool = False,
    gateable: bool = True,
    shown: bool = False,
) -> Callable[[Part], Part]:
    """Declare a Hidden force or a Filter as an effect; filters are never gated by a condition. The engine's
    controller reports a force that is `shown`."""

    def add(part: Part) -> Part:
        if issubclass(part, Hidden):
            part.shown = shown

        def build(setting: Setting, p: Sizes) -> Planted:
            if issubclass(part, Filter):
                return Planted(filters=(part(setting, p),))
            return Planted(forces=(part(setting, p),), conceal=part.conceal)

        gates = gateable and not issubclass(part, Filter)
        own = {"key": key, "name": name, "family": family, "leader": leader, "gateable": gates}
        _declare(part, build, "missing_physics", needs=needs, accepts=accepts, trucks=trucks, **own)
        return part

    return add


def fault(
    key: str, family: str, needs: str = EVERYWHERE, *, name: str, accepts: str = "", conceal: str = ""
) -> Callable[[Spoil], Spoil]:
    """Declare a function (p, channels, dt, rng) that spoils one recording's channels in place."""

    def add(spoil: Spoil) -> Spoil:
        def build(setting: Setting, p: Sizes) -> Planted:
            return Planted(faults=(partial(spoil, p),), conceal=tuple(conceal.split()))

        own = {"key": key, "name": name, "family": family}
        _declare(spoil, build, "measurement_fault", needs=needs, accepts=accepts, **own)
        return spoil

    return add


def planted(
    key: str,
    family: str,
    needs: str = EVERYWHERE,
    *,
    name: str,
    accepts: str = "",
    trucks: str = POOL,
    kind: Kind = "missing_physics",
) -> Callable[[Build], Build]:
    """Declare a function (setting, p) that says itself what is planted."""

    def add(build: Build) -> Build:
        own = {"key": key, "name": name, "family": family}
        _declare(build, build, kind, needs=needs, accepts=accepts, trucks=trucks, **own)
        return build

    return add
