"""Present step of a long command: step and elapsed time on a terminal, in a log a line per step and
minute.
"""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from deeptruck_model._terminal.progress_bar import A_MINUTE_S

QUIET_S = 2.0  # a log shows no step before: what refuses its input does so by one line


@contextmanager
def progress(
    first: str, every_s: float = A_MINUTE_S, quiet_s: float = QUIET_S
) -> Iterator[Callable[[str], None]]:
    """A function that reports on stderr which step begins; a terminal shows the `first` one at once, a log
    those after `quiet_s`."""
    from rich.console import Console

    console = Console(stderr=True)
    if console.is_terminal:
        from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

        columns = (SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn())
        with Progress(*columns, console=console, transient=True) as shown:
            task = shown.add_task(first)
            yield lambda step: shown.update(task, description=step)
        return
    begun = time.monotonic()
    now = first

    def line(text: str) -> None:
        print(f"{time.monotonic() - begun:4.0f} s: {text}", file=sys.stderr, flush=True)

    def say(step: str) -> None:
        nonlocal now
        now = step
        if time.monotonic() - begun > quiet_s:
            line(step)

    ended = threading.Event()

    def remind() -> None:
        while not ended.wait(every_s):
            line(f"still {now}")

    reminder = threading.Thread(target=remind, daemon=True)
    reminder.start()
    try:
        yield say
    finally:
        ended.set()
        reminder.join()


@contextmanager
def steps(say: Callable[[str], None] | None, first: str) -> Iterator[Callable[[str], None]]:
    """The function to which a Python call reports its steps: `say`; without it a terminal, and
    elsewhere lines on stderr once it takes longer than a minute."""
    if say is not None:
        yield say
    else:
        with progress(first, quiet_s=A_MINUTE_S) as shown:
            yield shown
