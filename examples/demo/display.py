"""Shows how far the steps are: a live table on a terminal, a line for each event elsewhere."""

from __future__ import annotations

import time
from collections.abc import Sequence
from types import TracebackType

from rich.console import Console
from rich.live import Live
from rich.table import Table

from examples.demo.runner import Progress

SIGNS = {"waiting": "·", "running": "▶", "done": "✓", "kept": "✓", "failed": "✗"}


class Display:
    """A context: `show` may be called as often as one likes."""

    def __init__(self) -> None:
        self._console = Console(stderr=True)
        self._live = Live(console=self._console, refresh_per_second=4, transient=False)
        self._printed: dict[str, str] = {}

    def __enter__(self) -> Display:
        if self._console.is_terminal:
            self._live.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._console.is_terminal:
            self._live.stop()

    def show(self, progress: Sequence[Progress]) -> None:
        """Take over where the steps stand."""
        if self._console.is_terminal:
            self._live.update(_table(progress))
            return
        for p in progress:
            if p.state != "waiting" and self._printed.get(p.step.name) != p.state:
                self._printed[p.step.name] = p.state
                which = f"step {list(self._printed).index(p.step.name) + 1} of {len(progress)}"
                took = f" {p.seconds:.0f} s" if p.state == "done" else ""
                print(f"{which}, {p.step.name}: {p.state}{took}  ({p.step.title})", flush=True)


def _table(progress: Sequence[Progress]) -> Table:
    table = Table(box=None, show_header=False, padding=(0, 1))
    table.add_column(no_wrap=True)
    table.add_column(no_wrap=True, justify="right", style="dim")
    table.add_column(no_wrap=True)
    table.add_column(no_wrap=True, justify="right")
    table.add_column(no_wrap=True, overflow="ellipsis", style="dim")
    for number, p in enumerate(progress, 1):
        seconds = time.monotonic() - p.begun if p.state == "running" and p.begun else p.seconds
        took = "kept" if p.state == "kept" else f"{seconds:.0f} s" if seconds else ""
        says = p.says.replace("[", r"\[") if p.state == "running" else ""
        table.add_row(SIGNS[p.state], f"{number}/{len(progress)}", p.step.title, took, says)
    return table
