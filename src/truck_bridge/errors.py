"""The one error a user can cause."""


class InputError(ValueError):
    """What the user gave cannot be used. The message is one line: what is wrong and how to mend it."""
