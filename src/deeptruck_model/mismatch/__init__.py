"""When simulation and recordings differ: locate it, say what is missing, model it, show the fit improve.

Loaded on first use, so that the command line can check what it is given within a moment.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from deeptruck_model.mismatch.corrected_truck import CorrectedTruck, load_directory
    from deeptruck_model.mismatch.output import apply, write
    from deeptruck_model.mismatch.tool import Mismatch, find_mismatch

__all__ = ["CorrectedTruck", "Mismatch", "apply", "find_mismatch", "load_directory", "write"]

_HOME = {
    "CorrectedTruck": "corrected_truck",
    "Mismatch": "tool",
    "apply": "output",
    "find_mismatch": "tool",
    "load_directory": "corrected_truck",
    "write": "output",
}


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOME[name]}"), name)
