"""The page that compares with the paper: the numbers that define its figures, and its tables.

Each number has unit, meaning and source: a section of the paper in quotation marks, or 'chosen' if the paper
gives none. Two commands write the modelling and the control half into one folder; each writes the page of the
halves that exist.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Literal

import numpy as np

from benchmarks.paper.results import MEASURED, PAPER_HALVES, PAPER_PAGE, PICTURES, SUMMARY, WORK
from deeptruck_model import files
from deeptruck_model.errors import InputError

# Training
LOOKS = 60
"""Validations of a training by the paper's recipe; chosen."""
SHORT_UPDATES = 4560
"""Gradient steps of the recipe's variants: 60 passes over 3.4 h; chosen."""
SEEDS = {"paper": 30, "default": 30, "unaided": 10}
"""Deep trucks of `trucksim` by recipe; "Model learning curves" has 30 of its own, 10 is chosen."""
BATCH = 10
"""Seeds trained side by side; their results do not depend on one another. Chosen."""
FIELD_SEEDS = 10
"""Deep trucks of each field truck by recipe; chosen."""
LOOKS_AT_FEEDBACK = 6
"""Validations from one look at what feedback costs to the next; chosen."""

# Runs of a deep truck
TRANSIENT_S = 2.0
"""s until the initial transient of a field run has decayed; "Results and model validation" gives no time."""
TRANSIENT_OF_SAMPLE_S = 10.0
"""s of the initial transient in the run of 200 s, of which the paper gives no length; chosen."""
SHARE_WITHIN = 0.95
"""Least share of runs that 'is expected to remain within 1.5 m/s' is taken to mean; chosen."""
ERRORS_S = 0.5
"""s from one point of an error figure to the next; chosen."""
DIGITS, DRAWN_DIGITS = 5, 3
"""Digits kept of a seed's figures, more than any page shows, and of curves that are only drawn; chosen."""
FIELD_RUNS, FIELD_S = 10, 15.0
"""Simulations of a field truck, and their length in s; "Results and model validation" of the field."""

# Probes
PROBE_FIT_MIN = 120.0
"""Minutes of driving to which a probe is fitted; chosen."""
PROBE_S = 40.0
"""s of a free run of the probes, as long as those of the error statistics; chosen."""
PROBE_AFTER_S = 5.0
"""s of it before the state is read, so that it depends on what was driven and not on its start; chosen."""
PROBE_PAST_S = (0.0, 0.5, 1.0, 2.0, 4.0)
"""s by which the inputs of the probe from past inputs lie back; chosen."""

# Control
DEEP_RUNS, TRUCK_RUNS = 100, 10
"""Runs of DeepEnv-set and TruckSIM-set; "Control validation results"."""
SET_S = 80.0
"""s of such a run: 800 steps of 0.1 s; "Training setup and learning curves"."""
SETTLED_S, STEADY_S = 10.0, 25.0
"""s after which the time gap and the speed are judged; "Control validation results"."""
OVERSHOOT_S = 20.0
"""s in which a speed error may change its side; by then those of the paper's figure are over."""
CLOSING_S, FOLLOWING_S = 40.0, 120.0
"""s of a run of gap closing and of long following; chosen."""
FIELD_SCENES = 10
"""Runs of each; chosen."""
CLOSED_TIME_GAP_S, CLOSED_SPEED = 0.35, 0.2
"""s and m/s within which the gap is closed; "Deep-RL control of full-size trucks"."""
RIPPLE_S = 17.0
"""s at which the leader begins to change its speed; "Deep-RL control of full-size trucks"."""
RIPPLE_PERIOD_S, RIPPLE = 4.0, 0.5
"""s and m/s^2 of its quick changes up and down, of which the paper gives no size; chosen."""
LANE_CHANGE_S = 10.0
"""s from the lane change on that count as its consequence; chosen."""
SCENES_SEED = 1000
"""Seed of the scenes, which no training draws; chosen."""


Value = float | tuple[float, ...] | None
Figures = Mapping[str, Any]
TITLE = "# Beside the paper"
EXPLAINED = """
Every figure and number of the paper with ours next to it, on our reference trucks: `trucksim` for TruckSIM,
`freightliner` and `volvo` for the two real ones, whose recordings are not public. A cell is the median of the
seeds, in brackets the least and the largest of them; it is in bold where any seed misses the paper's bound.
The row 'seeds' says how many ran. Two commands measure the whole page, and continue where they were stopped;
`--known docs/results/paper` counts the seeds that this page has. How long they take says
[speed](speed.md#time-of-the-page-beside-the-paper).

```bash
python benchmarks/paper/run.py modelling --workers 2 --out runs/experiments
python benchmarks/paper/run.py control --out runs/experiments
```
"""


@dataclass(frozen=True)
class Row:
    """One figure: its name, the paper's value, and its place among the figures of a seed.

    `value` gives a number or the ends of a range. `least` and `most` are the paper's bounds; without them
    nothing is missed. `better` is 'small' if the smaller magnitude is better, 'large', or '' if two trucks
    cannot be compared by it.
    """

    what: str
    paper: str
    value: Callable[[Figures], Value]
    least: float = -np.inf
    most: float = np.inf
    form: str = "{:.2f}"
    better: Literal["small", "large", ""] = "small"

    def merit(self, seed: Figures) -> float | None:
        """Larger is better; None if nothing was measured, or trucks cannot be compared by it."""
        value = self.value(seed)
        if value is None or not self.better:
            return None
        size = float(np.abs(value).max())
        return size if self.better == "large" else -size

    def cell(self, seeds: Sequence[Figures]) -> str:
        """The median over the seeds, bold if one misses a bound; '-' if nothing was measured."""
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


def worse(rows: Sequence[Row], ours: Sequence[Figures], theirs: Sequence[Figures]) -> dict[str, int]:
    """For each row, the number of seeds of `ours` that are not better than the median of `theirs`, if there
    are any."""
    found = {}
    for row in rows:
        mine, others = (
            [m for seed in seeds if (m := row.merit(seed)) is not None] for seeds in (ours, theirs)
        )
        if mine and others and (count := int((np.array(mine) <= np.median(others)).sum())):
            found[row.what] = count
    return found


def at(*path: str) -> Callable[[Figures], Value]:
    """A function that gives the number or range at a path into the figures of a seed; None if there
    is none."""

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
    """A figure with its caption; empty if it is not drawn yet."""
    return [f"![{says}]({PICTURES}/{name})", ""] if (folder / PICTURES / name).exists() else []


def write(folder: Path, half: str, lines: Sequence[str]) -> None:
    """Keep `lines` in `folder` as SUMMARY or one of PAPER_HALVES, and write MEASURED and the page of the
    parts that exist."""
    for needed in (WORK, PICTURES):
        (folder / needed).mkdir(exist_ok=True)
    figures = {path.stem: json.loads(path.read_text()) for path in sorted((folder / WORK).glob("*.json"))}
    compact = partial(json.dumps, separators=(",", ":"))
    lines_of = (f"{compact(name)}:{compact(found)}" for name, found in figures.items())
    files.write(folder / PICTURES / MEASURED, ("{\n" + ",\n".join(lines_of) + "\n}\n").encode())
    files.write(folder / WORK / half, ("\n".join(lines).rstrip() + "\n").encode())
    summary, *halves = (folder / WORK / name for name in (SUMMARY, *PAPER_HALVES))
    above = [f"\n{summary.read_text()}"] if summary.exists() else []
    text = "".join([f"{TITLE}\n", *above, EXPLAINED, *(f"\n{h.read_text()}" for h in halves if h.exists())])
    files.rewrite(folder / PAPER_PAGE, text.encode())


def restore(folder: Path, known: Path) -> None:
    """Copy the figures of seeds and the pictures of an earlier page from folder `known`, unless `folder` has
    its own. Raises InputError if `known` has no figures."""
    try:
        figures = dict(json.loads((known / MEASURED).read_text()))
    except (OSError, ValueError) as error:
        raise InputError(
            f"{known} has no {MEASURED} that can be read ({error}); give the folder of a page's pictures, "
            "such as docs/results/paper"
        ) from None
    for needed in (WORK, PICTURES):
        (folder / needed).mkdir(exist_ok=True)
    for name, found in figures.items():
        if not (kept := folder / WORK / f"{name}.json").exists():
            files.write(kept, json.dumps(found).encode())
    for picture in known.glob("*.png"):
        if not (shown := folder / PICTURES / picture.name).exists():
            files.write(shown, picture.read_bytes())
