"""All hidden effects, one folder for each part of the truck, one file for each name a right answer can have.

In: a `Setting` and drawn sizes. Out: what is `Planted`. Every effect belongs to one of twenty-one families,
which came from other sources one after the other; together they are the development set.
`deeptruck_exam.sealed` is for the next family. Importing this package registers them all.
"""

from __future__ import annotations

import importlib
import pkgutil

from deeptruck_exam import sealed
from deeptruck_exam.effects.planting import ALL, EFFECTS, FAMILIES, FORMS, Effect
from deeptruck_model.errors import InputError

for _paths, _package in ((__path__, __name__), (sealed.__path__, sealed.__name__)):
    for _found in pkgutil.walk_packages(_paths, f"{_package}."):
        importlib.import_module(_found.name)


def of_family(family: str = ALL) -> list[Effect]:
    """The effects of a family, or of all twenty-one. A wrong parameter has no law and is the same effect in
    every family. Raises InputError for a family that is not there."""
    wanted = FAMILIES if family == ALL else (family,)
    if not any(e.family in wanted for e in EFFECTS.values()):
        raise InputError(f"--forms: there are no effects of '{family}'; choose from {', '.join(FORMS)}")
    return [e for e in EFFECTS.values() if e.family in wanted or e.kind == "parameter_error"]


def named(family: str = ALL) -> list[Effect]:
    """Missing physics that has a name in the house's list."""
    return [e for e in of_family(family) if e.kind == "missing_physics" and e.name != "unknown"]


def unknown(family: str = ALL) -> list[Effect]:
    """Missing physics that has none."""
    return [e for e in of_family(family) if e.name == "unknown"]


def of_kind(kind: str, family: str = ALL) -> list[Effect]:
    return [e for e in of_family(family) if e.kind == kind]


__all__ = ["EFFECTS", "Effect", "named", "of_family", "of_kind", "unknown"]
