"""The one error a user can cause."""

from __future__ import annotations


class InputError(ValueError):
    """What the user gave cannot be used. The message is one line: what is wrong and how to mend it.

    Console scripts print it and exit with code 2.
    """


class MisfitsError(InputError):
    """Several of them, in one line; `found` has each."""

    def __init__(self, found: list[str]) -> None:
        listed = " ".join(f"({number}) {text}" for number, text in enumerate(found, 1))
        super().__init__(f"{len(found)} things do not fit: {listed}")
        self.found = found
