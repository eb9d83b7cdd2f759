"""The one error a user can cause, the same class in all rooms."""

from deeptruck_model.errors import InputError

__all__ = ["InputError"]
