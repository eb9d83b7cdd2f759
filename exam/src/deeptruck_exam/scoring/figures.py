"""Figures of the proof page."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from deeptruck_exam.scoring.scoreboard import Score, by_level, confusion

COMPARED = ("parameters_only", "tool")
COLOURS = {"parameters_only": "#9aa5b1", "tool": "#2a7f4f"}


def draw_all(results: Sequence[Score], out: Path) -> list[str]:
    """Write all figures for which there are results into `out`; returns the file names."""
    made = []
    for name, draw in (
        ("confusion", draw_confusion),
        ("levels", draw_levels),
        ("improvement", draw_improvement),
    ):
        figure = draw(results)
        if figure is not None:
            figure.savefig(out / f"{name}.png", dpi=110, bbox_inches="tight")
            plt.close(figure)
            made.append(f"{name}.png")
    return made


def draw_confusion(results: Sequence[Score]) -> Any:
    """True name against first stated name, as shares of the true name's cases."""
    table = confusion(results)
    if not table:
        return None
    rows = sorted({t for t, _ in table}, key=_last)
    columns = sorted({t for t, _ in table} | {s for _, s in table}, key=_last)
    counts = np.array([[table[r, c] for c in columns] for r in rows], float)
    shares = counts / counts.sum(axis=1, keepdims=True)
    figure, axes = plt.subplots(figsize=(0.32 * len(columns) + 3.0, 0.28 * len(rows) + 2.5))
    axes.imshow(shares, cmap="Greens", vmin=0.0, vmax=1.0, aspect="auto")
    for i, j in np.argwhere(counts > 0):
        colour = "white" if shares[i, j] > 0.6 else "black"
        axes.text(j, i, f"{counts[i, j]:.0f}", ha="center", va="center", fontsize=7, color=colour)
    axes.set_xticks(range(len(columns)), columns, rotation=90, fontsize=7)
    axes.set_yticks(
        range(len(rows)), [f"{r} ({counts[i].sum():.0f})" for i, r in enumerate(rows)], fontsize=7
    )
    axes.set_xlabel("first name said")
    axes.set_ylabel("hidden truth (cases)")
    return figure


def _last(name: str) -> tuple[bool, str]:
    return name in ("unknown", "nothing"), name


def draw_levels(results: Sequence[Score]) -> Any:
    """Rates of right first and in the group, by level, with 95 % intervals."""
    table = {k: v for k, v in by_level(results).items() if v["right first"] is not None}
    if not table:
        return None
    figure, axes = plt.subplots(figsize=(8.0, 0.42 * len(table) + 1.5))
    for row, (key, values) in enumerate(table.items()):
        for shift, name, colour in ((-0.15, "right first", "#2a7f4f"), (0.15, "in group", "#8cc7a1")):
            rate, n = values[name], values["n"]
            low, high = wilson(rate, n)
            axes.barh(row + shift, rate, 0.28, color=colour, label=name if row == 0 else None)
            axes.plot([low, high], [row + shift] * 2, color="black", lw=1)
        axes.text(1.01, row, f"n = {values['n']}", va="center", fontsize=8)
        del key
    axes.set_yticks(range(len(table)), [" ".join(k) for k in table])
    axes.set_xlim(0.0, 1.0)
    axes.invert_yaxis()
    axes.set_xlabel("share of cases")
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2, fontsize=8, frameon=False)
    return figure


def wilson(rate: float, n: int) -> tuple[float, float]:
    """Wilson's 95 % interval of a proportion."""
    z = 1.96
    centre = (rate + z * z / (2 * n)) / (1 + z * z / n)
    half = z * np.sqrt(rate * (1 - rate) / n + z * z / (4 * n * n)) / (1 + z * z / n)
    return float(max(centre - half, 0.0)), float(min(centre + half, 1.0))


def draw_improvement(results: Sequence[Score]) -> Any:
    """Cumulative distribution of the share of the oracle's held-out improvement, for tool and refit."""
    rows = [r["share"] for r in results if r.get("share")]
    if not rows:
        return None
    figure, axes = plt.subplots(figsize=(7.0, 4.0))
    for name in COMPARED:
        values = np.sort([r[name] for r in rows if name in r])
        if len(values):
            axes.step(
                np.clip(values, -0.5, 1.1),
                np.linspace(0.0, 1.0, len(values)),
                label=f"{name.replace('_', ' ')}, median {np.median(values):.2f}",
                color=COLOURS[name],
                lw=2.0,
            )
    axes.axvline(1.0, color="black", lw=0.8, ls=":")
    axes.set_xlabel("share of the oracle's improvement of the 40 s open-loop speed error, held-out drives")
    axes.set_ylabel("share of cases below")
    axes.legend(fontsize=8)
    return figure
