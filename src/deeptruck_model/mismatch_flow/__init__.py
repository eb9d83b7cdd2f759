"""Find what a simulator leaves out: what was not recorded, a budget, names as deep as the data carry.

Loaded on first use, so that the command line can check what it is given within a moment.
"""

from typing import TYPE_CHECKING

from deeptruck_model.lazy import names

if TYPE_CHECKING:
    from deeptruck_model.mismatch_flow.adaptation import adapt
    from deeptruck_model.mismatch_flow.find import find_mismatch
    from deeptruck_model.mismatch_flow.output import fill, write, write_profiles
    from deeptruck_model.mismatch_flow.report.lines import lines
    from deeptruck_model.mismatch_flow.result import Result

__all__ = ["Result", "adapt", "fill", "find_mismatch", "lines", "write", "write_profiles"]

__getattr__ = names(
    __name__,
    {
        "adaptation": ("adapt",),
        "find": ("find_mismatch",),
        "output": ("fill", "write", "write_profiles"),
        "report.lines": ("lines",),
        "result": ("Result",),
    },
)
