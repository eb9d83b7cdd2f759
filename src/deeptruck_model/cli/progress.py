"""What a long command is doing: one line that changes on a terminal, a line a step in a log."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

QUIET_S = 2.0  # a log tells no step before: what refuses its input does so by one line


@contextmanager
def progress(first: str) -> Iterator[Callable[[str], None]]:
    """A function that tells on stderr which step begins; a terminal shows the `first` one at once."""
    from rich.console import Console

    console = Console(stderr=True)
    if console.is_terminal:
        with console.status(first) as status:
            yield status.update
        return
    begun = time.monotonic()

    def say(step: str) -> None:
        passed_s = time.monotonic() - begun
        if passed_s > QUIET_S:
            print(f"{passed_s:4.0f} s: {step}", file=sys.stderr, flush=True)

    yield say
