"""The error for invalid input."""

from __future__ import annotations


class InputError(ValueError):
    """The user's input cannot be used. The message is one line: the error and its remedy.

    Console scripts print it and exit with code 2.
    """


class MisfitsError(InputError):
    """Several input errors, in one line; `found` has each."""

    def __init__(self, found: list[str]) -> None:
        listed = " ".join(f"({number}) {text}" for number, text in enumerate(found, 1))
        super().__init__(f"{len(found)} things do not fit: {listed}")
        self.found = found
