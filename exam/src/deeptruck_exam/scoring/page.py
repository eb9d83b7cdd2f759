"""proof.md and scoreboard.json: the results of the examination, failures included."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from deeptruck_core import files
from deeptruck_exam.laws import EFFECTS
from deeptruck_exam.scoring import scoreboard
from deeptruck_exam.scoring.figures import COMPARED, draw_all
from deeptruck_exam.scoring.scoreboard import Score, mean

HEADINGS = (
    "right first",
    "in group",
    "set size",
    "log score",
    "recall",
    "precision",
    "false statement",
    "unknown recognised",
    "input stated",
    "each drive found",
    "overlap",
    "intervals hold",
    "share of oracle",
    "beats refit",
    "failed",
)


def write_page(results: Sequence[Score], out: Path, command: str) -> dict[str, Any]:
    """Write proof.md, scoreboard.json and the figures into `out`; returns the scoreboard."""
    scored = [r for r in results if "broken" not in r]
    board = figures_of_merit(scored)
    board["broken"] = [r for r in results if "broken" in r]
    figures = draw_all(scored, out)
    _replace(out / "scoreboard.json", json.dumps(board, indent=1))
    _replace(out / "proof.md", "\n".join(_lines(scored, board, figures, command)) + "\n")
    return board


def _replace(path: Path, text: str) -> None:
    files.write(path, text.encode())


def figures_of_merit(scored: Sequence[Score]) -> dict[str, Any]:
    """The scoreboard as plain data: number of cases, results by level, rare effects split by the information
    in the recordings (nats), each method's median share of the improvement that the true law brings, how
    many intervals hold, median run time (s)."""
    levels = {f"{s} {level}": row for (s, level), row in scoreboard.by_level(scored).items()}
    shares = [r["share"] for r in scored if r.get("share")]
    intervals = [i for r in scored for i in r["intervals"]]
    return {
        "cases": len(scored),
        "levels": levels,
        "rare": scoreboard.rare_by_information(scored),
        "share_of_oracle": {
            name: float(np.median([s[name] for s in shares if name in s]))
            for name in COMPARED
            if any(name in s for s in shares)
        },
        "intervals": {"n": len(intervals), "hold": mean(i["holds"] for i in intervals)},
        "seconds_median": float(np.median([r["seconds"] for r in scored])) if scored else None,
    }


def _lines(
    scored: Sequence[Score], board: Mapping[str, Any], figures: Sequence[str], command: str
) -> list[str]:
    lines = [
        "# The proof: hidden effects",
        "",
        f"{board['cases']} cases, made and scored by `{command}`. A case is eight drives of four"
        " minutes on a random truck with a hidden effect; the truth's hash is written before the tool starts"
        " as a separate process. Laws, trucks, roads, drivers and sensors are in `deeptruck_exam`, which"
        " shares no code with the tool.",
        "",
        "## By level",
        "",
        "| level | n | " + " | ".join(HEADINGS) + " |",
        "| --- " * (len(HEADINGS) + 2) + "|",
    ]
    for level, row in board["levels"].items():
        lines.append(f"| {level} | {row['n']} | " + " | ".join(_cell(row[h]) for h in HEADINGS) + " |")
    lines += ["", *(f"![{name}]({name})\n" for name in figures), "## Rare effects by information", ""]
    lines += [f"- {name}: {_cell(value)}" for name, value in board["rare"].items()]
    lines += ["", "## Share of the oracle's improvement, median", ""]
    lines += [f"- {name}: {value:.2f}" for name, value in board["share_of_oracle"].items()]
    lines += [
        "",
        "## By effect",
        "",
        "| effect | cases | right first | in group | source |",
        "| --- " * 5 + "|",
    ]
    lines += _by_effect(scored)
    lines += ["", "## What was wrong", "", *_failures(scored)]
    if board["broken"]:
        lines += ["", f"{len(board['broken'])} cases broke before they were scored (scoreboard.json)."]
    return lines


def _cell(value: float | None) -> str:
    return "" if value is None else f"{value:.2f}"


def _by_effect(scored: Sequence[Score]) -> list[str]:
    out = []
    for key, effect in EFFECTS.items():
        rows = [r for r in scored if r["keys"] == [key]]
        if rows:
            first, group = mean(r["right_first"] for r in rows), mean(r["in_group"] for r in rows)
            out.append(f"| {key} | {len(rows)} | {_cell(first)} | {_cell(group)} | {effect.source} |")
    return out


def _failures(scored: Sequence[Score]) -> list[str]:
    """One line for each case in which the first name was wrong, a false statement was made, or the tool
    failed."""
    return [
        f"- {r['simulator']} {r['level']} {r['seed']}: {' '.join(r['keys']) or 'nothing'} was called"
        f" {' '.join(r['said']) or r['verdict']} ({r['information_left_nats']:.0f} nats beyond parameters)"
        for r in scored
        if r["outcome"] in ("wrong", "false_alarm", "failed")
    ] or ["Nothing."]
