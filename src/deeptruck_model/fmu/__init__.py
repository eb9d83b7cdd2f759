"""FMUs, both ways: somebody else's simulator comes in as one, a simulator of ours goes out as one.

`make` turns a .fmu file and what its variables mean into an object that `outside` takes for a simulator;
`export` writes one. FMPy and PythonFMU3, extra 'fmu', are loaded when they are needed.
"""

from pathlib import Path
from typing import TYPE_CHECKING

from deeptruck_model import lazy

if TYPE_CHECKING:
    from deeptruck_model.fmu.truck import FmuTruck, make

__all__ = ["FmuTruck", "make", "slave_file"]


def slave_file() -> Path:
    """The file that runs inside an exported FMU."""
    return Path(__file__).with_name("slave.py")


__getattr__ = lazy.names(__name__, {"truck": ("FmuTruck", "make")})
