"""Compares recordings, simulators and policies, aligned by time and by road.

Loaded on first use, so that the command line can check its arguments without delay.
"""

from typing import TYPE_CHECKING

from deeptruck_core.imports.lazy import names

if TYPE_CHECKING:
    from deeptruck_model.compare.comparison import Comparison, compare
    from deeptruck_model.compare.page import write

__all__ = ["Comparison", "compare", "write"]

__getattr__ = names(__name__, {"comparison": ("Comparison", "compare"), "page": ("write",)})
