"""Figures in the form of the paper's."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np

from deeptruck_cacc.environments.rollouts import Trace
from deeptruck_cacc.evaluation import metrics
from deeptruck_model.signals import TruckInterface, printed

mpl.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.ticker import MaxNLocator


def error_bands(trace: Trace, title: str, path: Path) -> None:
    """Time-gap and speed error over time: min/max dashed, sd shaded, mean."""
    figure, axes = plt.subplots(2, 1, figsize=(7, 5), sharex=True, layout="constrained")
    for axis, name, label in zip(
        axes, ("time_gap_error", "speed_error"), ("time-gap error [s]", "speed error [m/s]"), strict=True
    ):
        band = metrics.over_time(trace[name])
        axis.fill_between(
            trace.time,
            band["mean"] - band["sd"],
            band["mean"] + band["sd"],
            color="tab:red",
            alpha=0.3,
            label="sd",
        )
        axis.plot(trace.time, band["mean"], "tab:blue", label="mean")
        axis.plot(trace.time, band["min"], "k--", lw=0.8, label="min, max")
        axis.plot(trace.time, band["max"], "k--", lw=0.8)
        axis.axhline(0.0, color="0.6", lw=0.5)
        axis.set_ylabel(label)
    _legend_above(axes[0], 3)
    axes[0].set_title(title, fontsize="medium", loc="left")
    axes[1].set_xlabel("time [s]")
    _save(figure, path)


def field_run(trace: Trace, title: str, path: Path, interface: TruckInterface, row: int = 0) -> None:
    """One rollout as in the paper's field figures: speeds, time gap, commands in the units of `interface`,
    grade."""
    figure, axes = plt.subplots(4, 1, figsize=(7, 8), sharex=True, layout="constrained")
    t = trace.time
    axes[0].plot(t, trace["leader_speed"][:, row], "k", label="leader")
    axes[0].plot(t, trace["speed"][:, row], "tab:blue", label="truck")
    axes[0].set_ylabel("speed [m/s]")
    wanted = trace.scene.time_gap[row]
    axes[1].plot(t, trace["time_gap_error"][:, row] + wanted, "tab:blue", label="time gap")
    axes[1].axhline(wanted, color="k", lw=0.8, label="wanted")
    axes[1].set_ylabel("time gap [s]")
    axes[2].plot(t, trace["engine_command"][:, row], "tab:green", label="engine command")
    brake = axes[2].twinx()
    brake.plot(t, trace["brake_command"][:, row], "tab:red", lw=0.8)
    brake.set_ylabel(f"brake command [{printed(interface.unit('brake_command'))}]", color="tab:red")
    axes[2].set_ylabel(f"engine command [{printed(interface.unit('engine_command'))}]", color="tab:green")
    axes[3].plot(t, 100 * trace.scene.grade[row], "0.4", label="grade [%]")
    axes[3].plot(t, trace["acceleration"][:, row], "tab:blue", lw=0.8, label="acceleration [m/s²]")
    axes[3].set_xlabel("time [s]")
    for axis in (axes[0], axes[1], axes[3]):
        _legend_above(axis, 2)
    axes[0].set_title(title, fontsize="medium", loc="left")
    _save(figure, path)


def learning_curve(runs: list[list[dict[str, Any]]], path: Path) -> None:
    """Min/max shaded and mean over seeds, of the cost (analytic) or of the mean return (trpo)."""
    figure, axis = plt.subplots(figsize=(7, 3.5), layout="constrained")
    key = "cost" if "cost" in runs[0][0] else "return_mean"
    shortest = min(len(run) for run in runs)
    values = np.array([[np.atleast_1d(line[key]) for line in run[:shortest]] for run in runs])
    values = np.moveaxis(values, 1, 0).reshape(shortest, -1)  # (iteration, seed)
    if values.shape[1] > 1:
        low, high = values.min(axis=1), values.max(axis=1)
        axis.fill_between(range(shortest), low, high, color="tab:red", alpha=0.25, label="min, max")
    axis.plot(range(shortest), values.mean(axis=1), "darkred", label=_mean_of(values.shape[1]))
    if key == "cost":
        axis.set_yscale("log")
    else:
        axis.set_yscale("symlog", linthresh=1.0)
    axis.set(xlabel="iteration", ylabel=key.replace("_", " "))
    axis.xaxis.set_major_locator(MaxNLocator(integer=True))
    _legend_above(axis, 2)
    _save(figure, path)


def amplification(rows: dict[str, dict[str, Any]], path: Path) -> None:
    """String stability: amplification of speed and gap error along a platoon, by frequency."""
    figure, axes = plt.subplots(1, 2, figsize=(9, 4), sharex=True, layout="constrained")
    for name, row in rows.items():
        for axis, key in zip(axes, ("speed", "gap_error"), strict=True):
            axis.semilogx(row["frequency_hz"], row[f"worst_{key}_amplification"], ".-", label=name)
    for axis, label in zip(axes, ("speed", "gap error"), strict=True):
        axis.axhline(1.0, color="k", lw=0.8)
        axis.set(xlabel="frequency [Hz]", ylabel=f"worst amplification of {label}")
    _legend_above(axes[1], len(rows))
    _save(figure, path)


def _legend_above(axis: Any, columns: int) -> None:
    """Over the axes, where no curve can run beneath it."""
    place = {"loc": "lower right", "bbox_to_anchor": (1.0, 1.0), "borderaxespad": 0.2}
    axis.legend(ncols=columns, fontsize="small", frameon=False, **place)


def _mean_of(seeds: int) -> str:
    return "the only seed" if seeds == 1 else f"mean of {seeds} seeds"


def _save(figure: Any, path: Path) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=110)
    plt.close(figure)
