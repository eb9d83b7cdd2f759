"""Evaluation: the paper's sets and field runs, harder roads, baselines, platoons; tables and figures."""

from deeptruck_cacc.evaluation.report import evaluate, table

__all__ = ["evaluate", "table"]
