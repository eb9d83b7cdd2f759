"""Figure of channels over time, one row each."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from deeptruck_core.signals import printed

Array = NDArray[np.float64]

HELD = ("engine_command", "brake_command", "gear")  # until the next sample


class Row(NamedTuple):
    """One channel, with its unit; "1" if dimensionless."""

    name: str
    unit: str
    values: Array


def draw(title: str, time: Array, rows: Sequence[Row]) -> Figure:
    """Draw the rows below each other over `time`, in s."""
    figure = Figure(figsize=(10, 0.8 + 1.3 * len(rows)), layout="constrained")
    FigureCanvasAgg(figure)
    for ax, row in zip(figure.subplots(len(rows), sharex=True, squeeze=False)[:, 0], rows, strict=True):
        values = row.values.astype(np.float32)  # hides the rounding noise of a constant
        ax.plot(time, values, lw=1.0, drawstyle="steps-post" if row.name in HELD else "default")
        ax.set_ylabel(_label(row), rotation=0, ha="right", va="center")
        ax.ticklabel_format(axis="y", useOffset=False)
        ax.grid(alpha=0.3)
    figure.axes[-1].set_xlabel("time [s]")
    figure.suptitle(title)
    return figure


def _label(row: Row) -> str:
    name = row.name.replace("_", " ")
    return name if row.unit == "1" else f"{name}\n[{printed(row.unit)}]"
