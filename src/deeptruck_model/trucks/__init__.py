"""Physics trucks: the reference pool, their parameters, and the hooks for forces from outside."""

from typing import TYPE_CHECKING

from deeptruck_core.imports import lazy

if TYPE_CHECKING:
    from deeptruck_model.trucks.forces import CommandFilter, Force, View
    from deeptruck_model.trucks.parameters import PARAMETERS, Parameter
    from deeptruck_model.trucks.specification import Specification, pool
    from deeptruck_model.trucks.truck import PhysicsTruck, TruckState, load, load_directory, load_text

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
    "load_text",
    "pool",
]

__getattr__ = lazy.names(
    __name__,
    {
        "forces": ("CommandFilter", "Force", "View"),
        "parameters": ("PARAMETERS", "Parameter"),
        "specification": ("Specification", "pool"),
        "truck": ("PhysicsTruck", "TruckState", "load", "load_directory", "load_text"),
    },
)
