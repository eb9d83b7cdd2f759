"""Evaluation of controllers: the paper's scenes and field runs, harder roads, baselines, platoons; tables and
figures.
"""

from deeptruck_cacc.evaluation.page import table
from deeptruck_cacc.evaluation.report import evaluate

__all__ = ["evaluate", "table"]
