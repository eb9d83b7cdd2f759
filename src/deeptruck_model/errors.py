"""The errors of `deeptruck_core.errors`, under the name that they had."""

from deeptruck_core.errors import InputError

__all__ = ["InputError"]
