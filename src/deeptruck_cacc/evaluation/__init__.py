"""Evaluation: the paper's sets and field runs, harder roads, baselines, platoons; tables and figures."""

from deeptruck_cacc.evaluation.report import evaluate, evaluate_seeds, table

__all__ = ["evaluate", "evaluate_seeds", "table"]
