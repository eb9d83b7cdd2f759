"""Figure and table of losses against gradient updates, in both forms, over many seeds."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

COLOURS = {"training": "tab:blue", "deployment": "tab:red"}
ROWS = 8  # of the table, evenly spread on a logarithmic scale


def learning_curves_page(out: Path, curves: dict[str, Any]) -> None:
    """Write learning_curves.png and README.md under `out`. `curves` holds `updates` (n,) and the losses
    `training` and `deployment` (n, seeds) on unseen drives."""
    out.mkdir(parents=True, exist_ok=True)
    _figure(curves).savefig(out / "learning_curves.png", dpi=120)
    (out / "README.md").write_text(_table(curves))


def _figure(curves: dict[str, Any]) -> Figure:
    figure = Figure(figsize=(7, 4), layout="constrained")
    axis, at = figure.subplots(), curves["updates"]
    for form, colour in COLOURS.items():
        losses = np.array(curves[form])
        axis.fill_between(at, losses.min(1), losses.max(1), color=colour, alpha=0.25)
        axis.plot(at, losses.mean(1), color=colour, label=f"{form} form")
    axis.set(xlabel="gradient updates", ylabel="loss on an unseen drive", yscale="log")
    axis.set_title(_seeds(losses.shape[1]), fontsize="small", loc="right")
    axis.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2, fontsize="small", frameon=False)
    return figure


def _seeds(count: int) -> str:
    return "one seed" if count == 1 else f"mean, min and max of {count} seeds"


def _table(curves: dict[str, Any]) -> str:
    """Mean over the seeds, in brackets the least and the largest."""
    at, training, deployment = (np.array(curves[key]) for key in ("updates", *COLOURS))
    rows = np.unique(np.geomspace(1, len(at), ROWS).round().astype(int)) - 1
    lines = [
        "# Learning curves in paper mode",
        "",
        f"`deeptruck-model experiment learning-curves --seeds {training.shape[1]} --budget {at[-1]}`: 4 h of",
        f"`trucksim`, loss on an unseen hour for each form, {_seeds(training.shape[1])}.",
        "",
        "| updates | training form | deployment form |",
        "| ---: | ---: | ---: |",
        *(f"| {at[k]} | {_cell(training[k], 4)} | {_cell(deployment[k], 2)} |" for k in rows),
        "",
        "![learning curves](learning_curves.png)",
    ]
    return "\n".join(lines) + "\n"


def _cell(losses: np.ndarray[Any, Any], digits: int) -> str:
    mean, low, high = (f"{x:.{digits}f}" for x in (losses.mean(), losses.min(), losses.max()))
    return mean if len(losses) == 1 else f"{mean} ({low} to {high})"
