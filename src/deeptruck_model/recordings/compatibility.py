"""Decides whether a recording fits a simulator, from metadata or from samples."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass

from deeptruck_core.signals import TruckInterface

SAME_DT_S = 1e-6  # s in which two steps are one
FULL_BRAKING_BAR = 8.0  # usual of air brakes
IN_PERCENT = (
    f", by 'brake_command: {{column: ..., unit: percent, scale: {100 / FULL_BRAKING_BAR:g}}}' in COLUMNS "
    f"where the column is in bar and {FULL_BRAKING_BAR:g} bar brakes fully"
)
BY_GEARBOX = "; without '?gear=recorded' behind its name a truck chooses its own gear"


@dataclass(frozen=True)
class Given:
    """Properties of a recording, called `name` in messages.

    `lacks` returns whether a channel is certainly missing; `unit` returns that of a channel, None or "none"
    if unknown; `dt` is the step in s, None if only the samples show it.
    """

    name: str
    lacks: Callable[[str], bool]
    unit: Callable[[str], str | None]
    dt: float | None = None


@dataclass(frozen=True)
class Taken:
    """Properties of a simulator, called `name` in messages, and its step in s."""

    name: str
    interface: TruckInterface
    dt: float


def misfits(taken: Taken, given: Given) -> list[str]:
    """Reasons why a recording cannot drive a simulator, one line each: other step, missing channels, other
    units."""
    found = []
    if given.dt is not None and abs(given.dt - taken.dt) > SAME_DT_S:
        found.append(
            f"{given.name} is sampled every {given.dt:g} s, {taken.name} steps {taken.dt:g} s; "
            "give recordings of the simulator's rate"
        )
    channels = (*taken.interface.u, *taken.interface.w)
    lacking = [name for name in channels if given.lacks(name)]
    if lacking:
        found.append(
            f"{given.name} has no {', '.join(lacking)}, which {taken.name} needs; record it or use another "
            f"simulator{how_without(lacking)}"
        )
    for name in channels:
        here, there = given.unit(name), taken.interface.unit(name)
        if name not in lacking and here not in (None, "none", there):
            how = IN_PERCENT if (here, there) == ("bar", "percent") else ""
            found.append(
                f"{given.name} has {name} in {here}, {taken.name} takes {there}; record it in that "
                f"unit or use another simulator{how}"
            )
    return found


def how_without(lacking: Collection[str]) -> str:
    """How to do without channels that were not recorded, behind a sentence that names them; may be empty."""
    return BY_GEARBOX if "gear" in lacking else ""
