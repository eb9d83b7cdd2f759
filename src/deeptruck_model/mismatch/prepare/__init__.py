"""Recordings to drives: checked, aligned with the simulator, and driven by it."""
