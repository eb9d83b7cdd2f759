"""The one error a user can cause."""

LONGEST = 200  # characters that a library may say in one of our lines


def plain(said: str, longest: int = LONGEST) -> str:
    """What a library said, as one line without control characters, cut where it is long."""
    line = " ".join("".join(c if c.isprintable() else " " for c in said).split())
    return line if len(line) <= longest else f"{line[: longest - 3]}..."


class InputError(ValueError):
    """What the user gave cannot be used. The message is one line: what is wrong and how to mend it."""
