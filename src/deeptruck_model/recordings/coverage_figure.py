"""One page that shows what recordings hold."""

from __future__ import annotations

import io
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from deeptruck_model.recordings import coverage_grid as grid
from deeptruck_model.recordings.coverage_grid import Array, Counted
from deeptruck_model.signals import printed

SHOWN_FROM = -5.0  # m/s^2, or lower where there was braking as hard


def draw(found: Counted) -> bytes:
    """The figure as PNG: three maps of time spent, and which channels are valid in which recording."""
    figure = Figure(figsize=(12, 8.5), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(2, 2)
    with_grade, every = found.seconds[:, :, :-1], found.seconds
    speed, acceleration, grade = _axes(every.sum(axis=(0, 2)))
    _map(axes[0, 0], every.sum(axis=2), speed, acceleration)
    _map(axes[0, 1], with_grade.sum(axis=1), speed, grade)
    _map(axes[1, 0], with_grade.sum(axis=0), acceleration, grade)
    _channels(axes[1, 1], found)
    pieces = len(found.recordings)
    usual = every[:, grid.ACCELERATION_EDGES[:-1] >= SHOWN_FROM].sum(axis=2) > 0
    figure.suptitle(
        f"{found.duration_s / 3600:.2f} h in {pieces} recording{'s' if pieces != 1 else ''}, "
        f"{100 * usual.mean():.0f} % of the speed-acceleration cells visited"
    )
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=110)
    return buffer.getvalue()


class _Axis(NamedTuple):
    """An axis of the maps: the edges of its cells, and from where it is drawn."""

    label: str
    edges: Array
    shown_from: float


def _axes(by_acceleration: Array) -> tuple[_Axis, _Axis, _Axis]:
    """Speed, acceleration and grade; hard braking is drawn as far down as there was any."""
    hardest = grid.ACCELERATION_EDGES[np.flatnonzero(by_acceleration)[0]] if by_acceleration.any() else 0.0
    return (
        _Axis("speed [m/s]", grid.SPEED_EDGES, grid.SPEED_EDGES[0]),
        _Axis("acceleration [m/s²]", grid.ACCELERATION_EDGES, min(SHOWN_FROM, hardest)),
        _Axis("grade [%]", 100 * grid.GRADE_EDGES, 100 * grid.GRADE_EDGES[0]),
    )


def _map(ax: Axes, seconds: Array, x: _Axis, y: _Axis) -> None:
    ax.set_xlabel(x.label)
    ax.set_ylabel(y.label)
    ax.set_xlim(x.shown_from, x.edges[-1])
    ax.set_ylim(y.shown_from, y.edges[-1])
    if not seconds.any():
        ax.text(0.5, 0.5, "no grade recorded", transform=ax.transAxes, ha="center", va="center", color="0.4")
        return
    shown = np.where(seconds.T == 0.0, np.nan, seconds.T)
    norm = LogNorm(vmin=max(0.1, float(np.nanmin(shown))), vmax=max(1.0, float(np.nanmax(shown))))
    mesh = ax.pcolormesh(x.edges, y.edges, shown, norm=norm, cmap="viridis")
    ax.figure.colorbar(mesh, ax=ax, label="time spent, s")
    ax.grid(alpha=0.2)


def _channels(ax: Axes, found: Counted) -> None:
    """Rows are channels, blocks are recordings as wide as they are long, colour is the share of valid
    samples.
    """
    names = list(dict.fromkeys(name for r in found.recordings for name in r["channels"]))
    borders = np.concatenate([[0.0], np.cumsum([r["duration_s"] for r in found.recordings])]) / 60
    valid = np.array([[_valid(r, name) for r in found.recordings] for name in names])
    rows = np.arange(len(names) + 1)
    mesh = ax.pcolormesh(borders, rows, valid, vmin=0, vmax=1, cmap="RdYlGn")
    ax.figure.colorbar(mesh, ax=ax, label="share of valid samples (white: not there)")
    if len(borders) < 60:
        ax.vlines(borders, 0, len(names), color="white", lw=0.8)
    ax.set_yticks(rows[:-1] + 0.5, [f"{name}\n{_span(found, name)}" for name in names], fontsize=7)
    ax.invert_yaxis()
    ax.set_xlabel("recorded time [min]")


def _valid(recording: dict[str, Any], name: str) -> float:
    channel = recording["channels"].get(name)
    return float("nan") if channel is None else 1.0 - channel["nan_share"]


def _span(found: Counted, name: str) -> str:
    present = [r["channels"][name] for r in found.recordings if name in r["channels"]]
    lows = [c["min"] for c in present if c["min"] is not None]
    highs = [c["max"] for c in present if c["max"] is not None]
    if not lows:
        return "no valid sample"
    unit = printed(present[0]["unit"])
    return f"{min(lows):.4g} to {max(highs):.4g}" + ("" if unit == "1" else f" {unit}")
