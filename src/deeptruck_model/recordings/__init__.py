"""Bags and tables in, uniform recordings out."""

from deeptruck_model.recordings.recording import Recording

__all__ = ["Recording"]
