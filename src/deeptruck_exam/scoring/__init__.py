"""Scoring: the truth against the verdict, held-out errors of tool and rivals, and the result pages."""
