"""FMUs: imports other simulators, and exports simulators of this package.

`make` turns a .fmu file and the meaning of its variables into an object that `outside` accepts as a
simulator; `export` writes an FMU. FMPy and PythonFMU3, extra 'fmu', are loaded when they are needed.
"""

from pathlib import Path
from typing import TYPE_CHECKING

from deeptruck_core.imports import lazy

if TYPE_CHECKING:
    from deeptruck_model.fmu.truck import FmuTruck, make

__all__ = ["FmuTruck", "make", "slave_file"]


def slave_file() -> Path:
    """The file that runs inside an exported FMU."""
    return Path(__file__).with_name("slave.py")


__getattr__ = lazy.names(__name__, {"truck": ("FmuTruck", "make")})
