"""InputError, the error for invalid input; the same class in all packages."""

from deeptruck_core.errors import InputError

__all__ = ["InputError"]
