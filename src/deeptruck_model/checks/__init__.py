"""Fast checks of simulators and bags by their manifests and metadata, before anything heavy is imported.

A command calls these first, so that a wrong path or unit is reported within a second. They import only the
standard library and YAML, and numpy for a physics truck with overrides.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

from deeptruck_core.errors import InputError, MisfitsError
from deeptruck_core.vehicle_kinds import UNSTATED
from deeptruck_model.checks import compatibility
from deeptruck_model.checks.bags import (
    EXTRA_KEY,
    INTERFACE_KEY,
    MAGIC,
    METADATA,
    NOTES_KEY,
    RECORD_AGAIN,
    TOPICS,
    BagFacts,
    Clock,
    Mapped,
    bag,
)
from deeptruck_model.checks.compatibility import Given, Taken
from deeptruck_model.checks.simulators import (
    KINDS,
    MANIFEST,
    SCHEMES,
    WEIGHTS,
    SimulatorFacts,
    by_scheme,
    deep_simulator,
    manifest,
    simulator,
    trucks,
)

__all__ = [
    "EXTRA_KEY",
    "INTERFACE_KEY",
    "KINDS",
    "MAGIC",
    "MANIFEST",
    "METADATA",
    "NOTES_KEY",
    "RECORD_AGAIN",
    "SCHEMES",
    "TOPICS",
    "WEIGHTS",
    "BagFacts",
    "Clock",
    "Mapped",
    "SimulatorFacts",
    "adapted",
    "bag",
    "by_scheme",
    "deep_simulator",
    "every",
    "inputs",
    "manifest",
    "mass",
    "misfits",
    "refuse",
    "same_truck",
    "simulator",
    "trucks",
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


def inputs(simulator_text: str | None, bags: Sequence[Path], *, mapped: Mapped | None = None) -> None:
    """Check that the simulator and the bags, read by the topic map `mapped`, exist and are compatible.

    Raises one InputError with every misfit.
    """
    found: list[str] = []

    def tried(look: Callable[[], Any]) -> Any:
        try:
            return look()
        except InputError as error:
            found.append(str(error))

    facts = None if simulator_text is None else tried(lambda: simulator(simulator_text))
    known = [tried(partial(bag, path, mapped=mapped)) for path in dict.fromkeys(bags)]
    if facts is not None:
        found += [misfit for one in known if one is not None for misfit in misfits(facts, one)]
    refuse(found)


def held_out(recordings: Sequence[Path], others: Sequence[Path]) -> None:
    """Raises InputError for bags that are both fitted and held out, since the validation would be on training
    data."""
    fitted = {path.resolve() for path in recordings}
    if twice := [str(path) for path in dict.fromkeys(others) if path.resolve() in fitted]:
        raise InputError(
            f"{', '.join(twice)}: among the recordings and held out; hold out drives that are not fitted"
        )


def misfits(facts: SimulatorFacts, one: BagFacts) -> list[str]:
    """Reasons why a bag cannot be compared with a simulator, one line each: missing channels, different
    units."""
    taken = Taken(f"the simulator {facts.name}", facts.interface, facts.dt)
    return compatibility.misfits(taken, Given(str(one.path), one.lacks, one.unit))


def same_truck(bags: Sequence[Path], *, mapped: Mapped | None = None) -> None:
    """Raises InputError if bags cannot be used for one training: their commands differ in unit, or none has
    an engine command."""
    found: list[str] = []
    commanded = False
    first: dict[str, tuple[str, Path]] = {}
    for path in bags:
        try:
            one = bag(path, mapped=mapped)
        except InputError as error:
            found.append(str(error))
            continue
        commanded = commanded or not one.lacks("engine_command")
        for name in ("engine_command", "brake_command"):
            unit = one.unit(name)
            known, where = first.setdefault(name, (unit, path)) if unit else (unit, path)
            if unit != known:
                found.append(f"{path} has {name} in {unit}, {where} in {known}; train on bags of one truck")
    if not commanded and not found:
        found.append("no bag has an engine_command; a truck cannot be learned without it")
    refuse(found)


def adapted(start: str, bags: Sequence[Path], *, mapped: Mapped | None = None) -> None:
    """Raises InputError if training on these bags cannot start from the deep truck `start`."""
    facts = simulator(start)
    if facts.kind != "deep":
        raise InputError(f"{start} is no deep truck; only one of those can be adapted")
    found: list[str] = []
    for path in bags:
        with suppress(InputError):  # said by who looks at the bags themselves
            found += misfits(facts, bag(path, mapped=mapped))
    refuse(f"{misfit}, or train from scratch, without --from" for misfit in found)
