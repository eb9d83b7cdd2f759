"""Open-loop evaluation written to a folder: metrics.json and the paper's figures."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from deeptruck_model.deep import remarks
from deeptruck_model.deep.evaluation import HORIZON_S, TRIALS, Trials, against_time, statistics, trials
from deeptruck_model.deep.learned import is_deep
from deeptruck_model.pages.document import Picture, Table, document
from deeptruck_model.recordings import Recording
from deeptruck_model.results import EVALUATION
from deeptruck_model.signals import CHANNELS, SPEED, printed
from deeptruck_model.simulators import MinimalSimulator, Simulator, completed

LABELS = {"acceleration": "acceleration", "speed": "speed", "fuel_rate": "fuel rate"}


def evaluate(
    simulator: MinimalSimulator,
    recordings: Sequence[Recording],
    out: str | Path,
    count: int = TRIALS,
    horizon_s: float = HORIZON_S,
    seed: int = 0,
    *,
    overwrite: bool = False,
    named: str = "the simulator",
) -> dict[str, Any]:
    """Open-loop error statistics of any simulator: metrics.json, PNG figures and a page of both in `out`.

    All of them or none. An older evaluation there is replaced with `overwrite` only. `named` is what the page
    calls the simulator.
    """
    simulator = completed(simulator)
    with EVALUATION.replacing(Path(out), overwrite=overwrite) as draft:
        return evaluate_into(draft, simulator, recordings, count, horizon_s, seed, named)


def evaluate_into(
    folder: Path,
    simulator: Simulator,
    recordings: Sequence[Recording],
    count: int = TRIALS,
    horizon_s: float = HORIZON_S,
    seed: int = 0,
    named: str = "the simulator",
) -> dict[str, Any]:
    """The same files in an existing folder of the caller's own."""
    runs = trials(simulator, recordings, count, horizon_s, seed)
    metrics = {**statistics(runs), "seed": seed, "recordings": [r.name for r in recordings]}
    if is_deep(simulator) and simulator.details.get("calibration"):
        from deeptruck_model.deep.uncertainty import inside

        for name, share in inside(simulator, runs).items():
            metrics[name]["inside_90"] = share
    error_figure(runs).savefig(folder / "error_statistics.png", dpi=120)
    scenario_figure(runs).savefig(folder / "scenarios.png", dpi=120)
    sample_figure(runs).savefig(folder / "samples.png", dpi=120)
    (folder / "metrics.json").write_text(f"{json.dumps(metrics, indent=1)}\n")
    notes = remarks.remarks(simulator, recordings, metrics, horizon_s)
    (folder / "evaluation.html").write_text(page(metrics, folder, named, notes), encoding="utf-8")
    return metrics


SHOWN = {
    "error_statistics.png": "Mean and standard deviation of the error against the time since a run began.",
    "scenarios.png": "What the runs visited: speeds at the start and along the way, and slopes.",
    "samples.png": "Single runs: recorded and simulated.",
}
FIGURES = {
    "mean_abs": "mean abs error", "rmse": "rmse", "mean": "mean", "rmse_at_end": "rmse at the end",
    "largest": "largest", "inside_90": "inside the 90 % interval, %",
}  # fmt: skip


def page(metrics: dict[str, Any], folder: Path, named: str, notes: Sequence[str]) -> str:
    """evaluation.html: the numbers of metrics.json, and the figures that stand in the folder.

    `notes` say where the numbers are worth less than they look."""
    told = {name: x for name, x in metrics.items() if isinstance(x, dict)}
    kinds = {key: words for key, words in FIGURES.items() if any(key in x for x in told.values())}
    rows = [
        (f"{LABELS[name]}, {printed(CHANNELS[name].unit)}", *(_cell(x.get(key), key) for key in kinds))
        for name, x in told.items()
    ]
    speed = f"{told['speed']['rmse']:.3g} m/s" if "speed" in told else "not known"
    runs = f"{metrics['trials']} free runs of {metrics['horizon_s']:.0f} s"
    over = ", ".join(dict.fromkeys(metrics["recordings"]))
    first = f"{opened(named)} beside {over}: in {runs} the rms error of the speed is {speed}."
    pictures = [Picture((folder / name).read_bytes(), says) for name, says in SHOWN.items()]
    said = [f"Note: {line}." for line in notes]
    return document(first, said, [Table("Errors", ("channel", *kinds.values()), tuple(rows))], pictures)


def opened(named: str) -> str:
    """The name as a sentence begins; what is a path or a spec stays as it is."""
    return f"{named[:1].upper()}{named[1:]}" if " " in named else named


def _cell(value: float | None, key: str) -> str:
    if value is None:
        return ""
    return f"{100 * value:.0f}" if key == "inside_90" else f"{value:.4g}"


def error_figure(runs: Trials) -> Figure:
    """Mean (line) and standard deviation (area) of the error against time, one panel a channel."""
    mean, deviation = against_time(runs)
    figure = Figure(figsize=(7, 2.2 * len(runs.channels)), layout="constrained")
    axes = figure.subplots(len(runs.channels), 1, sharex=True, squeeze=False)[:, 0]
    for j, (axis, name) in enumerate(zip(axes, runs.channels, strict=True)):
        axis.fill_between(
            runs.time, (mean - deviation)[:, j], (mean + deviation)[:, j], color="tab:red", alpha=0.3,
            label="standard deviation",
        )  # fmt: skip
        axis.plot(runs.time, mean[:, j], color="tab:blue", label="mean")
        axis.axhline(0, color="0.6", lw=0.5)
        axis.set_ylabel(f"{LABELS[name]} error\n[{printed(CHANNELS[name].unit)}]")
    axes[0].legend(loc="upper left", ncols=2, fontsize="small")
    axes[0].set_title(f"open-loop error, {len(runs.measured)} trials")
    axes[-1].set_xlabel("time since the start of the simulation [s]")
    return figure


def scenario_figure(runs: Trials) -> Figure:
    """What the trials visited: initial speed, speed over time, grade over time."""
    panels = 3 if runs.w.shape[2] else 2
    figure = Figure(figsize=(4 * panels, 3.2), layout="constrained")
    axes = figure.subplots(1, panels)
    axes[0].hist(runs.measured[:, 0, SPEED], bins=20, color="tab:blue")
    axes[0].set(xlabel="initial speed [m/s]", ylabel="trials")
    axes[0].set_title(f"what {len(runs.measured)} trials visited")
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


def sample_figure(runs: Trials, shown: int = 4) -> Figure:
    """Measured and modelled responses of the best trial, the worst and evenly ranked ones between, by largest
    speed error."""
    worst = np.nanmax(np.abs(runs.error[..., SPEED]), axis=1)
    order = np.argsort(worst)
    places = np.linspace(0, len(order) - 1, min(shown, len(order))).astype(int)
    chosen = order[places]
    rows = len(runs.channels)
    figure = Figure(figsize=(3.4 * len(chosen), 1.9 * rows), layout="constrained")
    axes = figure.subplots(rows, len(chosen), sharex=True, squeeze=False)
    for column, trial in enumerate(chosen):
        for j, name in enumerate(runs.channels):
            axes[j, column].plot(runs.time, runs.measured[trial, :, j], color="k", lw=1, label="recorded")
            axes[j, column].plot(runs.time, runs.modelled[trial, :, j], color="tab:red", lw=1, label="model")
            axes[j, 0].set_ylabel(f"{LABELS[name]}\n[{printed(CHANNELS[name].unit)}]")
        title = f"{_rank(int(places[column]), len(order))}\nlargest speed error {worst[trial]:.2f} m/s"
        axes[0, column].set_title(title, fontsize="small")
        axes[-1, column].set_xlabel("time [s]")
    axes[0, 0].legend(fontsize="small")
    return figure


def _rank(place: int, runs: int) -> str:
    """What a run is among all when the best comes first."""
    return {0: "best run", runs - 1: "worst run"}.get(place, f"run {place + 1} of {runs}, best first")
