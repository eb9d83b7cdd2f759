"""The error for invalid input."""

from __future__ import annotations


class InputError(ValueError):
    """The user's input cannot be used. The message is one line: the error and its remedy.

    Console scripts print it and exit with code 2.
    """
