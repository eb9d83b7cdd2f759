"""plant.md: what was concealed in a plant, what the tool stated, and the held-out errors."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from statistics import median
from typing import Any

from deeptruck_exam.scoring.score import FAILED

DRIVEN = ("before", "parameters_only", "after")
ERRORS = (*DRIVEN, "offered")
Row = Mapping[str, Any]
HEAD = (
    *("simulator", "concealed", "said", "right first, in the set, named at all"),
    *("as given", "refitted", "corrected", "offered"),
)
RIGHT = {"right": (1, 1), "group": (0, 1)}  # outcome: right first, in the set
ABOUT = (
    "FASTSim (NREL) drives its class 8 line-haul truck; three drives are fitted and one is held out. The tool"
    " was developed on other seeds of it. Errors are m/s, the median of the seeds, of free runs on the drive"
    " held out; *offered* is the one of the three that the tool hands out. The simulators: FASTSim's"
    " equations solved forwards, one that `train` learned, and a physics truck of the data sheet by"
    " `new --recordings` and `calibrate-truck`, with which the drives are logged in the ten gears of a usual"
    " gearbox that its sheet has too, so that the shifting is not foreign."
)


def lines(rows: Sequence[Row]) -> list[str]:
    """The page."""
    seeds = sorted({r["seed"] for r in rows if r["true"]} or {r["seed"] for r in rows})  # more are nulls
    out = [
        "# FASTSim's line-haul truck",
        "",
        f"`deeptruck-model prove --plant fastsim --cases {len(seeds)} --seed {seeds[0]} --out DIR`",
        "",
        ABOUT,
        "",
    ]
    out += [f"| {' | '.join(HEAD)} |", "| --- " * len(HEAD) + "|"]
    for simulator, concealed in dict.fromkeys((r["simulator"], r["concealed"]) for r in rows):
        of_it = [r for r in rows if (r["simulator"], r["concealed"]) == (simulator, concealed)]
        out.append(f"| {' | '.join(_cells(simulator, concealed, of_it))} |")
    out += ["", *_totals(rows), ""]
    if failed := [r for r in rows if r["outcome"] == FAILED]:
        out += ["## Refused", ""]
        out += [f"- {r['simulator']}, {r['concealed']}: {r['says'].strip()}" for r in failed]
    return out


def _cells(simulator: str, concealed: str, rows: Sequence[Row]) -> list[str]:
    said = Counter(" ".join(r["said"]) or str(r["verdict"]) for r in rows)
    words = "; ".join(f"{what}{f' ({n})' if n > 1 else ''}" for what, n in said.most_common())
    known = ([r[name] for r in rows if r[name] is not None] for name in ERRORS)
    medians = (f"{median(values):.2f}" if values else "-" for values in known)
    return [simulator, concealed, words, right(rows), *medians]


def right(rows: Sequence[Row]) -> str:
    """Number of cases right first, in the set, and named by any finding; if nothing is concealed, the number
    without a finding."""
    if not rows[0]["true"]:
        return f"{sum(r['outcome'] == 'silent' for r in rows)} of {len(rows)} silent"
    first, group = (sum(RIGHT.get(r["outcome"], (0, 0))[i] for r in rows) for i in (0, 1))
    named = sum(r["recall"] > 0.0 for r in rows)
    return f"{first}, {group}, {named} of {len(rows)}"


def _totals(rows: Sequence[Row]) -> list[str]:
    out = []
    for simulator in dict.fromkeys(r["simulator"] for r in rows):
        hidden = [r for r in rows if r["simulator"] == simulator and r["true"]]
        nulls = [r for r in rows if r["simulator"] == simulator and not r["true"]]
        both = (("concealed:", hidden), ("nothing:", nulls))
        parts = [f"{about} {right(some)}" for about, some in both if some]
        out.append(f"- {simulator}: {'; '.join(parts)}.")
    return out
