"""Prepares recordings for the comparison with a simulator, and counts rejected samples by rule."""
