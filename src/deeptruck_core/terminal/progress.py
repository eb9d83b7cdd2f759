"""Progress of a long command on stderr: a bar with the remaining time, or the present step with the elapsed
time; a line per step and minute where there is no terminal. And TensorBoard curves.
"""

from __future__ import annotations

import sys
import threading
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    SpinnerColumn,
    Task,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.text import Text

if TYPE_CHECKING:
    from torch.utils.tensorboard import SummaryWriter


A_MINUTE_S = 60.0
QUIET_S = 2.0  # a log shows no step before: what refuses its input does so by one line
SCRIPT_QUIET_S = 10.0  # the same of a Python call, of which there may be many
LEAST_STEPS, LEAST_SHARE = 10, 0.02  # done before the time left is estimated: first steps compile


def _can_estimate(done: int, total: int) -> bool:
    return done >= LEAST_STEPS and done >= LEAST_SHARE * total


class _TimeLeft(TimeRemainingColumn):
    def render(self, task: Task) -> Text:
        first = task.fields["first"]
        known = _can_estimate(int(task.completed) - first, int(task.total or 0) - first)
        return super().render(task) if known else Text("-:--:--", style="progress.remaining")


@contextmanager
def bar(label: str, every_s: float = A_MINUTE_S) -> Iterator[Callable[[int, int, str], None]]:
    """A function to report steps done, total steps and a remark. Nothing is shown before its first call."""
    console = Console(stderr=True)
    if not console.is_terminal:
        yield _lines(label, every_s)
        return
    shown = Progress(
        TextColumn(label),
        BarColumn(),
        MofNCompleteColumn(),
        _TimeLeft(),
        TextColumn("{task.fields[remark]}"),
        console=console,
    )

    def show(done: int, total: int, remark: str) -> None:
        if not shown.tasks:
            shown.start()
            shown.add_task("", remark="", first=done)
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
        known = _can_estimate(done - first, total - first)
        left = f", {_left(now - begun, done - first, total - done)} left" if known else ""
        print(
            f"{label}: {done} of {total}{left}{f'; {remark}' if remark else ''}", file=sys.stderr, flush=True
        )

    return show


def _left(passed_s: float, done: int, to_do: int) -> str:
    seconds = passed_s / done * to_do
    return f"about {seconds / 60:.0f} min" if seconds >= 90.0 else f"about {seconds:.0f} s"


@contextmanager
def progress(
    first: str, every_s: float = A_MINUTE_S, quiet_s: float | None = None
) -> Iterator[Callable[[str], None]]:
    """A function that reports on stderr which step begins; a terminal shows the `first` one at once, a log
    the one that runs after `quiet_s` (QUIET_S where absent) and those that begin later, and one line every
    `every_s`. 'driving, 5 %' goes on with 'driving'."""
    quiet_s = QUIET_S if quiet_s is None else quiet_s
    console = Console(stderr=True)
    if console.is_terminal:
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
        begins = _begun(step) != _begun(now)
        now = step
        if begins and time.monotonic() - begun > quiet_s:
            line(step)

    ended = threading.Event()

    def remind() -> None:
        if ended.wait(quiet_s):
            return
        line(now)
        while not ended.wait(every_s):
            line(f"still {now}")

    reminder = threading.Thread(target=remind, daemon=True)
    reminder.start()
    try:
        yield say
    finally:
        ended.set()
        reminder.join()


def _begun(step: str) -> str:
    """The step without how much of it is done."""
    name, _, done = step.rpartition(", ")
    return name if done.endswith("%") else step


@contextmanager
def steps(say: Callable[[str], None] | None, first: str) -> Iterator[Callable[[str], None]]:
    """The function to which a Python call reports its steps: `say`; without it a terminal, and
    elsewhere lines on stderr once it takes longer than SCRIPT_QUIET_S."""
    if say is not None:
        yield say
    else:
        with progress(first, quiet_s=SCRIPT_QUIET_S) as shown:
            yield shown


def board(folder: Path, start: int) -> SummaryWriter:
    """A writer of curves into `folder`, starting at step `start`.

    It writes in a thread. If that fails, as on a full disk, its next call raises the same OSError.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        from torch.utils.tensorboard import SummaryWriter
    _quiet_thread()
    return SummaryWriter(str(folder), purge_step=start)


def _quiet_thread() -> None:
    """Keep the writer's thread from printing a traceback of an error that is also raised here; other errors
    are printed as before."""
    before = threading.excepthook
    if getattr(before, "__module__", "") == __name__:
        return

    def hook(given: threading.ExceptHookArgs) -> None:
        is_writer = type(given.thread).__module__.startswith("tensorboard.")
        if not (is_writer and isinstance(given.exc_value, OSError)):
            before(given)

    threading.excepthook = hook
