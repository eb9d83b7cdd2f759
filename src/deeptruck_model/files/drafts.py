"""What a command has begun to write, and must not leave behind however it ends."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

_removals: list[Callable[[], object]] = []


@contextmanager
def removing(remove: Callable[[], object]) -> Iterator[None]:
    """`remove()` at the end of the block, or before, where the process ends without unwinding its stack."""
    _removals.append(remove)
    try:
        yield
    finally:
        with suppress(ValueError):
            _removals.remove(remove)
        remove()


def remove_all() -> None:
    """Remove what all open blocks have begun, the innermost first; for whoever ends the process at once."""
    while _removals:
        with suppress(Exception):
            _removals.pop()()
