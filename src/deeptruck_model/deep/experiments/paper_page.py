"""A page of tables: a row for each figure of the paper, a column for each recipe, misses in bold.

The modelling and the control half are written by two commands into one folder; each writes the page of the
halves that are there.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from deeptruck_model import files
from deeptruck_model.results import PAPER_HALVES, PAPER_PAGE, PICTURES, WORK

Value = float | tuple[float, ...] | None
Figures = Mapping[str, Any]
TITLE = """# Beside the paper

Every figure and number of the paper with ours next to it, on our reference trucks: `trucksim` for TruckSIM,
`freightliner` and `volvo` for the two real ones, whose recordings are not public. A cell is the median of the
seeds, in brackets the least and the largest of them; it is in bold where any seed misses the paper's bound.
The row 'seeds' says how many ran. Two commands measure the whole page, and continue where they were stopped:

```bash
deeptruck-model experiment paper --out runs/experiments
deeptruck-cacc experiment paper --out runs/experiments
```
"""


@dataclass(frozen=True)
class Row:
    """One figure: what it is, what the paper says, and where it is among the figures of a seed.

    `value` gives a number or the ends of a range. `least` and `most` are the paper's bounds; without them
    nothing is missed.
    """

    what: str
    paper: str
    value: Callable[[Figures], Value]
    least: float = -np.inf
    most: float = np.inf
    form: str = "{:.2f}"

    def cell(self, seeds: Sequence[Figures]) -> str:
        """The median over the seeds, bold where one misses; '-' where nothing was measured."""
        found = [value for seed in seeds if (value := self.value(seed)) is not None]
        if not found:
            return "-"
        ends = np.array([np.atleast_1d(value) for value in found])  # (seeds, 1 or 2)
        middle = np.median(ends, axis=0)
        text = " to ".join(self.form.format(x) for x in middle)
        if len(found) > 1:
            text += f" ({' to '.join(self.form.format(x) for x in (ends.min(), ends.max()))})"
        missed = bool((ends < self.least).any() or (ends > self.most).any())
        return (f"**{text}**" if missed else text).replace("%", " %")


def at(*path: str) -> Callable[[Figures], Value]:
    """Gives the number, or the range, at a path into the figures of a seed; None where there is none."""

    def find(figures: Figures) -> Value:
        value: Any = figures
        for key in path:
            value = None if value is None else value.get(key)
        return tuple(value) if isinstance(value, list) else value

    return find


def table(rows: Sequence[Row], recipes: Mapping[str, Sequence[Figures]]) -> list[str]:
    """Lines of a table. `recipes` maps headings to the figures of their seeds."""
    counts = [str(len(seeds)) if seeds else "not run" for seeds in recipes.values()]
    lines = [f"| | paper | {' | '.join(recipes)} |", "|---" * (len(recipes) + 2) + "|"]
    lines.append(f"| seeds | | {' | '.join(counts)} |")
    for row in rows:
        lines.append(f"| {row.what} | {row.paper} | {' | '.join(map(row.cell, recipes.values()))} |")
    return [*lines, ""]


def picture(folder: Path, name: str, says: str) -> list[str]:
    """A figure with its caption; nothing where it is not drawn yet."""
    return [f"![{says}]({PICTURES}/{name})", ""] if (folder / PICTURES / name).exists() else []


def write(folder: Path, half: str, lines: Sequence[str]) -> None:
    """Keep one of PAPER_HALVES in `folder`, and write the page of those that are there."""
    (folder / WORK).mkdir(exist_ok=True)
    files.write(folder / WORK / half, ("\n".join(lines).rstrip() + "\n").encode())
    halves = [folder / WORK / name for name in PAPER_HALVES]
    text = "\n".join([TITLE, *(half.read_text() for half in halves if half.exists())])
    files.rewrite(folder / PAPER_PAGE, text.encode())
