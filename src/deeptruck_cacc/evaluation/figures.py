"""Figures in the style of the paper."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from deeptruck_cacc.environments.rollouts import Trace
from deeptruck_cacc.evaluation import metrics
from deeptruck_core.pages.style import GUIDE, MODELLED, RECORDED, WIDTH_IN, plain_log, png, styled
from deeptruck_core.signals import TruckInterface, printed


@styled()
def error_bands(trace: Trace, path: Path) -> None:
    """Time-gap and speed error over time: min/max dashed, sd shaded, mean."""
    figure = Figure(figsize=(WIDTH_IN, 4.4))
    axes = figure.subplots(2, 1, sharex=True)
    for axis, name, label in zip(
        axes, ("time_gap_error", "speed_error"), ("time-gap error [s]", "speed error [m/s]"), strict=True
    ):
        band = metrics.over_time(trace[name])
        axis.fill_between(
            trace.time,
            band["mean"] - band["sd"],
            band["mean"] + band["sd"],
            color=MODELLED,
            alpha=0.25,
            lw=0,
            label="sd",
        )
        axis.plot(trace.time, band["mean"], color=MODELLED, label="mean")
        axis.plot(trace.time, band["min"], "--", color=RECORDED, lw=0.8, label="min, max")
        axis.plot(trace.time, band["max"], "--", color=RECORDED, lw=0.8)
        axis.axhline(0.0, color="0.6", lw=0.5)
        axis.set_ylabel(label)
    _legend_above(axes[0], 3)
    axes[1].set_xlabel("time [s]")
    _save(figure, path)


@styled()
def field_run(trace: Trace, path: Path, interface: TruckInterface) -> None:
    """The first rollout as in the paper's field figures: speeds, time gap, commands in the units of
    `interface`, acceleration, grade."""
    figure = Figure(figsize=(WIDTH_IN, 8.2))
    axes = figure.subplots(6, 1, sharex=True)
    t = trace.time
    wanted = trace.scene.time_gap[0]
    axes[0].plot(t, trace["leader_speed"][:, 0], color=RECORDED, label="leader")
    axes[0].plot(t, trace["speed"][:, 0], color=MODELLED, label="truck")
    axes[1].axhline(wanted, color=GUIDE, label="requested")
    axes[1].plot(t, trace["time_gap_error"][:, 0] + wanted, color=MODELLED)
    axes[2].plot(t, trace["acceleration"][:, 0], color=MODELLED)
    axes[3].plot(t, trace["engine_command"][:, 0], color=MODELLED)
    axes[4].plot(t, trace["brake_command"][:, 0], color=MODELLED)
    axes[5].plot(t, 100 * trace.scene.grade[0], color=RECORDED)
    engine, brake = (printed(interface.unit(name)) for name in ("engine_command", "brake_command"))
    labels = ("speed\n[m/s]", "time gap\n[s]", "acceleration\n[m/s²]", f"engine\n[{engine}]",
              f"brake\n[{brake}]", "grade\n[%]")  # fmt: skip
    for axis, label in zip(axes, labels, strict=True):
        axis.set_ylabel(label)
        axis.margins(x=0)
    axes[5].set_xlabel("time [s]")
    _legend_above(axes[0], 2)
    figure.align_ylabels(axes)
    _save(figure, path)


@styled()
def learning_curve(runs: list[list[dict[str, Any]]], path: Path) -> None:
    """Min/max shaded and mean over seeds, of the cost (analytic) or of the mean return (trpo)."""
    figure = Figure(figsize=(WIDTH_IN, 3.2))
    axis = figure.subplots()
    key = "cost" if "cost" in runs[0][0] else "return_mean"
    shortest = min(len(run) for run in runs)
    values = np.array([[np.atleast_1d(line[key]) for line in run[:shortest]] for run in runs])
    values = np.moveaxis(values, 1, 0).reshape(shortest, -1)  # (iteration, seed)
    if values.shape[1] > 1:
        low, high = values.min(axis=1), values.max(axis=1)
        axis.fill_between(range(shortest), low, high, color=MODELLED, alpha=0.25, lw=0, label="min, max")
    axis.plot(range(shortest), values.mean(axis=1), color=MODELLED, label=_mean_of(values.shape[1]))
    if key == "cost":
        axis.set_yscale("log")
        plain_log(axis.yaxis)
    else:
        axis.set_yscale("symlog", linthresh=1.0)
    axis.set(xlabel="iteration", ylabel=key.replace("_", " "))
    axis.xaxis.set_major_locator(MaxNLocator(integer=True))
    _legend_above(axis, 2)
    _save(figure, path)


@styled()
def amplification(rows: dict[str, dict[str, Any]], path: Path) -> None:
    """String stability: amplification of speed and gap error along a platoon, by frequency."""
    figure = Figure(figsize=(WIDTH_IN, 5.6))
    axes = figure.subplots(2, 1, sharex=True)
    for name, row in rows.items():
        for axis, key in zip(axes, ("speed", "gap_error"), strict=True):
            axis.semilogx(row["frequency_hz"], row[f"worst_{key}_amplification"], ".-", label=name)
    plain_log(axes[0].xaxis)
    for axis, label in zip(axes, ("speed", "gap error"), strict=True):
        axis.axhline(1.0, color=RECORDED, lw=0.8)
        axis.set_ylabel(f"worst amplification\nof {label}")
    axes[1].set_xlabel("frequency [Hz]")
    _legend_above(axes[0], 2)
    _save(figure, path)


def _legend_above(axis: Any, columns: int) -> None:
    """Put the legend above the axes, where it covers no curve."""
    place = {"loc": "lower right", "bbox_to_anchor": (1.0, 1.0), "borderaxespad": 0.2}
    axis.legend(ncols=columns, **place)


def _mean_of(seeds: int) -> str:
    return "the only seed" if seeds == 1 else f"mean of {seeds} seeds"


def _save(figure: Figure, path: Path) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(png(figure))
