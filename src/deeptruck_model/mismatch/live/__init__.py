"""Mismatch analysis while driving: names from the newest messages, and a monitor of the residual."""
