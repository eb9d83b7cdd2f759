"""Pictures of what recordings hold: maps of the time spent, and the channels over time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from deeptruck_model.pages.style import MODELLED, WIDTH_IN, png, styled
from deeptruck_model.recordings import coverage_grid as grid
from deeptruck_model.recordings.coverage_grid import Array, Counted
from deeptruck_model.recordings.recording import Recording
from deeptruck_model.signals import printed

SHOWN_FROM = -5.0  # m/s^2, or lower where there was braking as hard
COLUMNS = 500  # of a channel's picture, each with the least and the most that was recorded there


@styled()
def draw(found: Counted) -> bytes:
    """Three maps of time spent over speed, acceleration and grade, as PNG."""
    figure = Figure(figsize=(WIDTH_IN, 6.2))
    FigureCanvasAgg(figure)
    axes = figure.subplot_mosaic("AA;BC")
    with_grade, every = found.seconds[:, :, :-1], found.seconds
    speed, acceleration, grade = _axes(every.sum(axis=(0, 2)))
    _map(axes["A"], every.sum(axis=2), speed, acceleration)
    _map(axes["B"], with_grade.sum(axis=1), speed, grade)
    _map(axes["C"], with_grade.sum(axis=0), acceleration, grade)
    return png(figure)


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
    ax.figure.colorbar(mesh, ax=ax, label="time spent [s]")


@styled()
def draw_channels(recordings: Sequence[Recording]) -> bytes:
    """Every channel over the recorded time, one small panel each, as PNG; a gap where it is invalid."""
    names = list(dict.fromkeys(name for r in recordings for name in r.channels))
    figure = Figure(figsize=(WIDTH_IN, 0.6 + 0.75 * len(names)))
    FigureCanvasAgg(figure)
    axes = figure.subplots(len(names), 1, sharex=True, squeeze=False)[:, 0]
    begin = 0.0
    for recording in recordings:
        minutes = begin + recording.dt * np.arange(len(recording)) / 60
        begin += recording.dt * len(recording) / 60
        for axis, name in zip(axes, names, strict=True):
            if name in recording.channels:
                _envelope(axis, minutes, recording.channels[name])
            if len(recordings) > 1:
                axis.axvline(begin, color="0.8", lw=0.6)
    for axis, name in zip(axes, names, strict=True):
        unit = next(r.interface.unit(name) for r in recordings if name in r.channels)
        said = "" if unit in ("", "1") else f"\n[{printed(unit)}]"
        axis.set_ylabel(f"{name.replace('_', ' ')}{said}", rotation=0, ha="right", va="center", fontsize=8)
        axis.tick_params(labelsize=7)
        axis.set_xlim(0.0, begin)
        axis.locator_params(axis="y", nbins=3)
    axes[-1].set_xlabel("recorded time [min]")
    return png(figure)


def _envelope(axis: Axes, minutes: Array, values: Array) -> None:
    """The least and the most of the valid values in each of COLUMNS columns."""
    columns = max(1, len(values) // COLUMNS)
    whole = len(values) // columns * columns
    blocks, times = values[:whole].reshape(-1, columns), minutes[:whole:columns]
    valid = ~np.isnan(blocks)
    known = valid.any(axis=1)
    low = np.where(valid, blocks, np.inf).min(axis=1)
    high = np.where(valid, blocks, -np.inf).max(axis=1)
    low, high = np.where(known, low, np.nan), np.where(known, high, np.nan)
    axis.fill_between(times, low, high, color=MODELLED, alpha=0.4, lw=0)
    axis.plot(times, (low + high) / 2, color=MODELLED, lw=0.8)
