"""What an experiment leaves behind: its table, its numbers, and figures that are its own."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from deeptruck_model.deep.arguments import Arguments
from deeptruck_model.deep.evaluation import Trials
from deeptruck_model.deep.report import LABELS
from deeptruck_model.deep.truck import DeepTruck
from deeptruck_model.recordings import Recording
from deeptruck_model.signals import CHANNELS, SPEED
from deeptruck_model.simulators import free_run


def sample_run(truck: DeepTruck, test: Recording, path: Path) -> None:
    """One run of 200 s, initialised once, and its error."""
    piece = test.piece(3000, 5001)
    modelled = free_run(truck, piece.u[None], piece.w[None], piece.y[:1]).y
    runs = Trials(piece.u[None], piece.w[None], piece.y[None], modelled, truck.dt, truck.interface.y)
    figure = Figure(figsize=(9, 7), layout="constrained")
    axes = figure.subplots(len(runs.channels), 2, sharex=True)
    for j, name in enumerate(runs.channels):
        axes[j, 0].plot(runs.time, runs.measured[0, :, j], "k", lw=1, label="truck")
        axes[j, 0].plot(runs.time, runs.modelled[0, :, j], "tab:red", lw=1, label="model")
        axes[j, 1].plot(runs.time, runs.error[0, :, j], "tab:blue", lw=1)
        axes[j, 0].set_ylabel(f"{LABELS[name]} [{CHANNELS[name].unit}]")
        axes[j, 1].set_ylabel(f"error [{CHANNELS[name].unit}]")
    axes[1, 0].legend()
    axes[0, 0].set_title(f"largest speed error {np.abs(runs.error[0, :, SPEED]).max():.2f} m/s")
    for axis in axes[-1]:
        axis.set_xlabel("time [s]")
    figure.savefig(path, dpi=120)


def budget(truck: DeepTruck) -> str:
    """What the training took, for the reader of a table."""
    config, training = truck.details["config"], truck.details["training"]
    return f"{config['members']} seed(s), {training['updates']} updates each, mode {config['mode']}."


def table(out: Path, title: str, rows: list[tuple[str, dict[str, Any]]], note: str = "") -> None:
    """Write README.md under `out`: one row of `statistics` for each name."""
    lines = [
        f"# {title}",
        "",
        *([note, ""] if note else []),
        "| | speed: sd at end | mean abs | within 1.5 m/s | acceleration: mean abs | fuel rate: mean abs |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    for name, m in rows:
        within = 100 * m["speed"]["trials_within_1.5"]
        fuel = f"{m['fuel_rate']['mean_abs']:.3f}" if "fuel_rate" in m else ""
        lines.append(
            f"| {name} | {m['speed']['sd_at_end']:.3f} | {m['speed']['mean_abs']:.3f} "
            f"| {within:.1f} % | {m['acceleration']['mean_abs']:.4f} | {fuel} |"
        )
    out.mkdir(parents=True, exist_ok=True)
    (out / "README.md").write_text("\n".join(lines) + "\n")


def write(out: Path, metrics: dict[str, Any]) -> dict[str, Any]:
    """Write metrics.json under `out`, with the settings that hold where nothing else is said."""
    out.mkdir(parents=True, exist_ok=True)
    content = {**metrics, "arguments": asdict(Arguments())}
    (out / "metrics.json").write_text(json.dumps(content, indent=1) + "\n")
    return metrics
