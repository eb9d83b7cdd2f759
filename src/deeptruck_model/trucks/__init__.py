"""Physics trucks: the reference pool, their parameters, and the hooks for forces from outside.

Names are loaded when they are asked for: the compiled parts take a second, and a check of overrides needs
none of them.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from deeptruck_model.trucks.forces import CommandFilter, Force, View
    from deeptruck_model.trucks.parameters import PARAMETERS, Parameter
    from deeptruck_model.trucks.specification import Specification, pool
    from deeptruck_model.trucks.truck import PhysicsTruck, TruckState, load, load_directory

__all__ = [
    "PARAMETERS",
    "CommandFilter",
    "Force",
    "Parameter",
    "PhysicsTruck",
    "Specification",
    "TruckState",
    "View",
    "load",
    "load_directory",
    "pool",
]

_ROOMS = {
    "forces": ("CommandFilter", "Force", "View"),
    "parameters": ("PARAMETERS", "Parameter"),
    "specification": ("Specification", "pool"),
    "truck": ("PhysicsTruck", "TruckState", "load", "load_directory"),
}
_ROOM_OF = {name: room for room, names in _ROOMS.items() for name in names}


def __getattr__(name: str) -> Any:
    if name not in _ROOM_OF:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_ROOM_OF[name]}"), name)
