"""The mismatch tool: unrecorded inputs, error budget, missing effects, and a corrected simulator.

The modules are loaded on first use, so that the command line checks its input without delay.
"""

from typing import TYPE_CHECKING

from deeptruck_core.imports.lazy import names

if TYPE_CHECKING:
    from deeptruck_model.mismatch.correction.corrected_truck import CorrectedTruck, load_directory
    from deeptruck_model.mismatch.find import find_mismatch
    from deeptruck_model.mismatch.mechanisms import LIBRARY
    from deeptruck_model.mismatch.output import apply, read, summary, write
    from deeptruck_model.mismatch.prepare.drives import Span
    from deeptruck_model.mismatch.report.found import Mismatch
    from deeptruck_model.mismatch.verdict.result import Verdict

__all__ = [
    "LIBRARY",
    "CorrectedTruck",
    "Mismatch",
    "Span",
    "Verdict",
    "apply",
    "find_mismatch",
    "load_directory",
    "read",
    "summary",
    "write",
]

__getattr__ = names(
    __name__,
    {
        "correction.corrected_truck": ("CorrectedTruck", "load_directory"),
        "find": ("find_mismatch",),
        "report.found": ("Mismatch",),
        "mechanisms": ("LIBRARY",),
        "output": ("apply", "read", "summary", "write"),
        "prepare.drives": ("Span",),
        "verdict.result": ("Verdict",),
    },
)
