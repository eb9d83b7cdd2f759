"""Evaluation of controllers: the paper's scenes and field runs, harder roads, baselines, platoons; tables and
figures.
"""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from deeptruck_cacc.evaluation.overview import best_table, table
    from deeptruck_cacc.evaluation.report import evaluate, evaluate_seeds

__all__ = ["best_table", "evaluate", "evaluate_seeds", "table"]


def __getattr__(name: str) -> Any:
    """Load these functions on first use, so that output file names are known without importing figures."""
    if name not in __all__:
        raise AttributeError(name)
    from deeptruck_cacc.evaluation import overview, report

    return getattr(overview if name.endswith("table") else report, name)
