"""FMUs: those of others as simulators, and simulators of this package as FMUs (extra 'fmu')."""

from typing import TYPE_CHECKING

from deeptruck_core.imports import lazy

if TYPE_CHECKING:
    from deeptruck_model.fmu.truck import FmuTruck, make

__all__ = ["FmuTruck", "make"]

__getattr__ = lazy.names(__name__, {"truck": ("FmuTruck", "make")})
