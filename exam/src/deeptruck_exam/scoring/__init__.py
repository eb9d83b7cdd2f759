"""Scoring: the truth against the verdict, held-out errors of tool and refit, and the result pages."""
