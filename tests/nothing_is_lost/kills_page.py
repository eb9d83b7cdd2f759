"""The page of `kills.py`: how many runs of each command were ended, by what, and what was wrong then."""

from __future__ import annotations

import signal
from collections.abc import Sequence
from pathlib import Path
from typing import Protocol

HEAD = """# Ended at random moments

`python tests/nothing_is_lost/kills.py --runs 200 --page docs/results/kills.md` writes this page.

Each run was ended at a random moment of its work, a third of them in its last tenth, and then started again.
`kill -9` ends the process that was started alone; Ctrl-C reaches all of them. Wrong is a run that left a half
result under its final name, a process or shared memory, or that gave another result than an undisturbed one
once it was started again. Compared are the bytes of weights and verdict; of a bag, its messages by topic.

| command | `kill -9` | Ctrl-C | of these in the last tenth | only after its end | wrong |
| --- | ---: | ---: | ---: | ---: | ---: |
"""


class Ended(Protocol):
    """What the page says of one run; see `kills.Disturbed`."""

    @property
    def command(self) -> str: ...
    @property
    def number(self) -> signal.Signals: ...
    @property
    def part(self) -> float: ...
    @property
    def ended_before(self) -> bool: ...
    @property
    def wrong(self) -> tuple[str, ...]: ...


def page(found: Sequence[Ended], older: Path) -> str:
    """The page with a row for each command in `found`, after the rows that `older` has of others."""
    names = list(dict.fromkeys(one.command for one in found))
    rows = [line for line in _rows(older) if line.split("|")[1].strip() not in names]
    rows += [_row(name, [one for one in found if one.command == name]) for name in names]
    counts = [[int(cell) for cell in row.split("|")[2:-1]] for row in rows]
    runs, wrong = sum(sum(row[:2]) for row in counts), sum(row[-1] for row in counts)
    said = [f"- {one.command}, {one.number.name}: {'; '.join(one.wrong)}" for one in found if one.wrong]
    return "\n".join([HEAD.rstrip(), *rows, "", f"{runs} runs, {wrong} wrong.", *said, ""])


def _rows(older: Path) -> list[str]:
    lines = older.read_text().splitlines() if older.exists() else []
    return [line for line in lines if line.startswith("| ") and not line.startswith(("| command", "| ---"))]


def _row(name: str, runs: Sequence[Ended]) -> str:
    cells = (
        sum(one.number == signal.SIGKILL for one in runs),
        sum(one.number == signal.SIGINT for one in runs),
        sum(one.part >= 0.9 for one in runs),
        sum(one.ended_before for one in runs),
        sum(bool(one.wrong) for one in runs),
    )
    return f"| {name} | " + " | ".join(map(str, cells)) + " |"
