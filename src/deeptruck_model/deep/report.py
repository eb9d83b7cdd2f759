"""Writes an open-loop evaluation to a folder: metrics.json and the paper's figures."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from deeptruck_core.pages.document import Part, Picture, Table, document
from deeptruck_core.pages.style import MODELLED, RECORDED, WIDTH_IN, png, styled
from deeptruck_core.signals import CHANNELS, SPEED, printed, sensible
from deeptruck_model import calls
from deeptruck_model.deep import remarks
from deeptruck_model.deep.evaluation import (
    CONSTANT,
    HORIZON_S,
    TRIALS,
    Trials,
    against_time,
    baselines,
    inside,
    statistics,
    trials,
)
from deeptruck_model.deep.remarks import is_deep
from deeptruck_model.recordings import Recording
from deeptruck_model.recordings.several import Drives, drives
from deeptruck_model.results import EVALUATION
from deeptruck_model.simulators import MinimalSimulator, Simulator, completed

LABELS = {"acceleration": "acceleration", "speed": "speed", "fuel_rate": "fuel rate"}


def evaluate(
    simulator: MinimalSimulator | str | Path,
    recordings: Drives,
    out: str | Path,
    count: int = TRIALS,
    horizon_s: float = HORIZON_S,
    seed: int = 0,
    *,
    overwrite: bool = False,
    named: str = "the simulator",
) -> dict[str, Any]:
    """Open-loop error statistics of any simulator: writes metrics.json, PNG figures and a page of both to
    `out`.

    All files or none are written. An older evaluation there is replaced only with `overwrite`. `named` is the
    simulator's name on the page. A simulator may be named as for `load`, recordings by paths of bags.
    """
    folder = calls.path(out, "out")
    calls.integer(count, "count", 1)
    calls.integer(seed, "seed")
    calls.number(horizon_s, "horizon_s", "s")
    simulator = completed(simulator)
    known = drives(recordings, rate_hz=1.0 / simulator.dt)
    with EVALUATION.replacing(folder, overwrite=overwrite) as draft:
        return evaluate_into(draft, simulator, known, count, horizon_s, seed, named)


def evaluate_into(
    folder: Path,
    simulator: Simulator,
    recordings: Sequence[Recording],
    count: int = TRIALS,
    horizon_s: float = HORIZON_S,
    seed: int = 0,
    named: str = "the simulator",
) -> dict[str, Any]:
    """The same files in an existing folder of the caller."""
    runs = trials(simulator, recordings, count, horizon_s, seed)
    metrics = {**statistics(runs), "seed": seed, "recordings": [r.name for r in recordings]}
    if is_deep(simulator) and simulator.details.get("calibration"):
        for name, share in inside(simulator, runs).items():
            metrics[name]["inside_90"] = share
    metrics["baselines"] = baselines(runs, simulator.interface, simulator)
    for name, draw in DRAWN.items():
        (folder / name).write_bytes(png(draw(runs)))
    (folder / "metrics.json").write_text(f"{json.dumps(metrics, indent=1)}\n")
    notes = remarks.remarks(simulator, recordings, metrics, horizon_s)
    (folder / "evaluation.html").write_text(page(metrics, folder, named, notes), encoding="utf-8")
    return metrics


SHOWN = {
    "samples.png": "Single runs, recorded and simulated, from the best to the worst by largest speed error.",
    "error_statistics.png": "Mean and standard deviation of the error against the time since a run began.",
    "scenarios.png": "The driving in these runs: speeds at the start and along the way, and slopes.",
}
FIGURES = {
    "rmse": "rms error", "mean_abs": "mean absolute", "mean": "mean", "rmse_at_end": "rms at the end",
    "largest": "largest", "inside_90": "inside the 90 % interval, %",
}  # fmt: skip


def page(metrics: dict[str, Any], folder: Path, named: str, notes: Sequence[str]) -> str:
    """evaluation.html: the numbers of metrics.json, and the figures in the folder.

    `notes` explain where the errors are less certain than they appear.
    """
    evaluated = {name: x for name, x in metrics.items() if isinstance(x, dict)}
    kinds = {key: words for key, words in FIGURES.items() if any(key in x for x in evaluated.values())}
    rows = [
        (f"{LABELS[name]}, {printed(CHANNELS[name].unit)}", *(_cell(x.get(key), key) for key in kinds))
        for name, x in evaluated.items()
    ]
    others = metrics["baselines"]
    compared = [
        (f"{LABELS[name]}, {printed(CHANNELS[name].unit)}", _cell(x["rmse"]),
         *(_cell(b[name]["rmse"]) if name in b else "" for b in others))
        for name, x in evaluated.items()
    ]  # fmt: skip
    over = ", ".join(dict.fromkeys(metrics["recordings"]))
    runs = f"{metrics['trials']} free runs of {metrics['horizon_s']:.0f} s along {over}, by {named}."
    heads = ("channel", "simulator", *(b["name"] for b in others))
    pictures = [Picture((folder / name).read_bytes(), says) for name, says in SHOWN.items()]
    parts: list[Part] = [
        Table("Rms error, and that of the baselines", heads, tuple(compared)),
        *pictures,
        Table("All figures of the error", ("channel", *kinds.values()), tuple(rows)),
    ]
    return document(judgement(metrics), [runs, *(f"Note: {line}." for line in notes)], parts)


def judgement(metrics: dict[str, Any]) -> str:
    """The speed error in one sentence, compared with the baselines."""
    if "speed" not in metrics:
        return "No speed was recorded to judge the simulator by."
    ours = metrics["speed"]["rmse"]
    said = {True: "smaller than that of", False: "not smaller than that of"}
    parts: list[str] = []
    for better in (True, False):
        names = [
            f"{'a' if b['name'] == CONSTANT else 'the'} {b['name']} ({b['speed']['rmse']:.2f} m/s)"
            for b in metrics["baselines"]
            if (ours < b["speed"]["rmse"]) is better
        ]
        if names:
            parts.append(f"{said[better]} {' and '.join(names)}")
    over = f"free runs of {metrics['horizon_s']:.0f} s"
    return f"The rms speed error is {ours:.2f} m/s over {over}, {', and '.join(parts)}."


def opened(named: str) -> str:
    """The name with a capital letter; a path or specification stays as it is."""
    return f"{named[:1].upper()}{named[1:]}" if " " in named else named


def _cell(value: float | None, key: str = "") -> str:
    if value is None:
        return ""
    return f"{100 * value:.0f}" if key == "inside_90" else sensible(value)


@styled()
def error_figure(runs: Trials) -> Figure:
    """Mean (line) and standard deviation (area) of the error against time, one panel a channel."""
    mean, deviation = against_time(runs)
    figure = Figure(figsize=(WIDTH_IN, 0.6 + 1.6 * len(runs.channels)))
    axes = figure.subplots(len(runs.channels), 1, sharex=True, squeeze=False)[:, 0]
    for j, (axis, name) in enumerate(zip(axes, runs.channels, strict=True)):
        axis.fill_between(
            runs.time, (mean - deviation)[:, j], (mean + deviation)[:, j], color=MODELLED, alpha=0.25, lw=0,
            label="standard deviation",
        )  # fmt: skip
        axis.plot(runs.time, mean[:, j], color=MODELLED, label="mean")
        axis.axhline(0, color="0.6", lw=0.5)
        axis.set_ylabel(f"{LABELS[name]}\n[{printed(CHANNELS[name].unit)}]")
    axes[0].legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2)  # above, where it covers no curve
    axes[-1].set_xlabel("time since the start of the run [s]")
    figure.align_ylabels(axes)
    return figure


@styled()
def scenario_figure(runs: Trials) -> Figure:
    """The conditions of the trials: initial speed, speed over time, grade over time."""
    panels = 3 if runs.w.shape[2] else 2
    figure = Figure(figsize=(WIDTH_IN, 2.2 * panels))
    axes = figure.subplots(panels, 1)
    axes[0].hist(runs.measured[:, 0, SPEED], bins=20, color=MODELLED)
    axes[0].set(xlabel="initial speed [m/s]", ylabel="runs")
    _density(axes[1], runs.time, runs.measured[..., SPEED], "speed [m/s]")
    if panels == 3:
        _density(axes[2], runs.time, 100 * runs.w[..., 0], "grade [%]")
    return figure


def _density(axis: Any, time: np.ndarray[Any, Any], values: np.ndarray[Any, Any], label: str) -> None:
    times = np.broadcast_to(time, values.shape)
    known = np.isfinite(values)
    *_, mesh = axis.hist2d(times[known], values[known], bins=(min(40, len(time)), 25), cmap="Blues")
    axis.figure.colorbar(mesh, ax=axis, label="samples")
    axis.set(xlabel="time [s]", ylabel=label)


@styled()
def sample_figure(runs: Trials) -> Figure:
    """Measured and modelled responses of four trials: the best, the worst and evenly ranked ones between, by
    largest speed error."""
    worst = np.nanmax(np.abs(runs.error[..., SPEED]), axis=1)
    order = np.argsort(worst)
    places = np.linspace(0, len(order) - 1, min(4, len(order))).astype(int)
    chosen = order[places]
    rows = len(runs.channels)
    figure = Figure(figsize=(WIDTH_IN, 0.8 + 1.4 * rows))
    axes = figure.subplots(rows, len(chosen), sharex=True, sharey="row", squeeze=False)
    for column, trial in enumerate(chosen):
        for j, name in enumerate(runs.channels):
            axes[j, column].plot(runs.time, runs.measured[trial, :, j], color=RECORDED, label="recorded")
            axes[j, column].plot(runs.time, runs.modelled[trial, :, j], color=MODELLED, label="model")
            axes[j, 0].set_ylabel(f"{LABELS[name]}\n[{printed(CHANNELS[name].unit)}]")
        place, runs_ = int(places[column]), len(order)  # the best run first
        rank = {0: "best run", runs_ - 1: "worst run"}.get(place, f"run {place + 1} of {runs_}")
        title = f"{rank}\n{worst[trial]:.2f} m/s"
        axes[0, column].set_title(title, fontsize=8)
        axes[-1, column].set_xlabel("time [s]")
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside upper left", ncols=2)
    return figure


DRAWN = {
    "error_statistics.png": error_figure, "scenarios.png": scenario_figure, "samples.png": sample_figure,
}  # fmt: skip
