"""How far a training is, on the terminal."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn


@contextmanager
def telling() -> Iterator[Callable[[int, int, str], None]]:
    """What a trainer tells, as a bar; bad input, which ends before anything is told, shows none."""
    bar = Progress(
        TextColumn("training"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
        TextColumn("{task.fields[says]}"),
        console=Console(stderr=True),
    )

    def tell(done: int, total: int, says: str) -> None:
        if not bar.tasks:
            bar.start()
            bar.add_task("", says="")
        bar.update(bar.task_ids[0], completed=done, total=total, says=says)

    try:
        yield tell
    finally:
        if bar.tasks:  # one that never started would leave an empty line
            bar.stop()
