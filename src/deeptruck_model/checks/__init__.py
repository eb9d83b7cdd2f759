"""What simulators and bags say of themselves in manifests and metadata, before anything heavy is imported."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from deeptruck_core.errors import InputError, MisfitsError
from deeptruck_core.vehicle_kinds import UNSTATED
from deeptruck_model.checks.bags import METADATA, Clock, bag
from deeptruck_model.checks.simulators import (
    KINDS,
    MANIFEST,
    SCHEMES,
    WEIGHTS,
    by_scheme,
    manifest,
    simulator,
)

__all__ = [
    "KINDS",
    "MANIFEST",
    "METADATA",
    "SCHEMES",
    "WEIGHTS",
    "Clock",
    "bag",
    "by_scheme",
    "every",
    "manifest",
    "mass",
    "refuse",
    "simulator",
]


def every(*tries: Callable[[], object]) -> None:
    """Call all checks. Raises one InputError with all misfits, each once."""
    found: list[str] = []
    for attempt in tries:
        try:
            attempt()
        except MisfitsError as several:
            found += several.found
        except InputError as error:
            found.append(str(error))
    refuse(found)


def refuse(misfits: Iterable[str]) -> None:
    """Raises InputError if there are misfits: a single one as it is, several counted in one line."""
    found = list(dict.fromkeys(misfits))
    if len(found) == 1:
        raise InputError(found[0])
    if found:
        raise MisfitsError(found)


def mass(mass_kg: float | None) -> None:
    """Raises InputError for a mass (kg) that no vehicle can have."""
    low, high = UNSTATED.least_mass_kg, UNSTATED.most_mass_kg
    if mass_kg is None or low <= mass_kg <= high:
        return
    tonnes = low <= 1000.0 * mass_kg <= high
    cure = (
        f"if {mass_kg:g} t were meant, give {1000.0 * mass_kg:g}"
        if tonnes
        else f"state what the truck weighs, {low:g} to {high:g} kg"
    )
    raise InputError(f"a mass of {mass_kg:g} kg is no vehicle's; {cure}")
