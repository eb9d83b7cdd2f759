"""Checks of arguments of Python calls, before anything is computed; errors are one line with the remedy.

Each function returns the value in the form used, and raises InputError for a wrong type.
"""

from __future__ import annotations

import math
from numbers import Integral, Real
from pathlib import Path
from typing import Any, TypeVar

from deeptruck_core.errors import InputError
from deeptruck_core.vehicle_kinds import UNSTATED

T = TypeVar("T")
SHOWN = 60  # characters of a value that a line repeats


def shown(value: Any) -> str:
    """A value as a short text within a line."""
    text = " ".join(repr(value).split())
    return text if len(text) <= SHOWN else f"{text[:SHOWN]}..."


def path(value: Any, name: str) -> Path:
    """A Path from str or Path."""
    if not isinstance(value, str | Path) or not str(value):
        raise InputError(f"{name} must be a path such as 'drives/monday', not {shown(value)}")
    return Path(value)


def integer(value: Any, name: str, least: int = 0) -> int:
    """An integer of at least `least`, for seeds and counts."""
    if isinstance(value, bool) or not isinstance(value, Integral) or value < least:
        raise InputError(f"{name} must be an integer of {least} or more, not {shown(value)}")
    return int(value)


def number(value: Any, name: str, unit: str = "") -> float:
    """A finite Python or numpy number."""
    if isinstance(value, bool) or not isinstance(value, Real) or not math.isfinite(value):
        raise InputError(f"{name} must be a number{f' in {unit}' if unit else ''}, not {shown(value)}")
    return float(value)


def instance(value: Any, kind: type[T], name: str, cure: str) -> T:
    """Return `value` if it is a `kind`; else raise InputError with the advice `cure`."""
    if not isinstance(value, kind):
        raise InputError(f"{name} must be a {kind.__name__}, not {shown(value)}; {cure}")
    return value


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
