"""The textbook laws of the effects: sixty laws and ten sensor faults with their sources, one file for each
part of the truck.

Importing this package registers all of them in the catalogue.
"""

from __future__ import annotations

from deeptruck_exam.laws import (
    air,
    brakes,
    commands,
    driveline,
    engine,
    load,
    parameters,
    road,
    sensors,
    tyres,
    unknown,
)
from deeptruck_exam.laws.catalogue import EFFECTS, UNKNOWN, Effect, Kind


def of_kind(kind: Kind) -> list[Effect]:
    """All effects of a kind."""
    return [e for e in EFFECTS.values() if e.kind == kind]


def named() -> list[Effect]:
    """Laws that have a name in the tool's library."""
    return [e for e in of_kind("missing_physics") if e.name != UNKNOWN]


def nameless() -> list[Effect]:
    """Laws that have no name in the tool's library."""
    return [e for e in of_kind("missing_physics") if e.name == UNKNOWN]


__all__ = [
    "EFFECTS",
    "Effect",
    "air",
    "brakes",
    "commands",
    "driveline",
    "engine",
    "load",
    "named",
    "nameless",
    "of_kind",
    "parameters",
    "road",
    "sensors",
    "tyres",
    "unknown",
]
