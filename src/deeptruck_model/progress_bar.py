"""How far a long computation is: a bar with the time left on a terminal, a line a minute elsewhere."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

A_MINUTE_S = 60.0


@contextmanager
def bar(label: str, every_s: float = A_MINUTE_S) -> Iterator[Callable[[int, int, str], None]]:
    """A function of steps done, steps in total and a remark. Nothing is shown before its first call."""
    console = Console(stderr=True)
    if not console.is_terminal:
        yield _lines(label, every_s)
        return
    shown = Progress(
        TextColumn(label),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
        TextColumn("{task.fields[remark]}"),
        console=console,
    )

    def show(done: int, total: int, remark: str) -> None:
        if not shown.tasks:
            shown.start()
            shown.add_task("", remark="")
        shown.update(shown.task_ids[0], completed=done, total=total, remark=remark)

    try:
        yield show
    finally:
        if shown.tasks:  # one that never started would leave an empty line
            shown.stop()


def _lines(label: str, every_s: float) -> Callable[[int, int, str], None]:
    begun = last = time.monotonic()
    first: int | None = None

    def show(done: int, total: int, remark: str) -> None:
        nonlocal last, first
        now = time.monotonic()
        first = done if first is None else first
        if now - last < every_s:
            return
        last = now
        left = f", {_left(now - begun, done - first, total - done)} left" if done > first else ""
        print(
            f"{label}: {done} of {total}{left}{f'; {remark}' if remark else ''}", file=sys.stderr, flush=True
        )

    return show


def _left(passed_s: float, done: int, to_do: int) -> str:
    seconds = passed_s / done * to_do
    return f"about {seconds / 60:.0f} min" if seconds >= 90.0 else f"about {seconds:.0f} s"
