"""The output of an experiment: tables, numbers, figures and learning curves."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure

from deeptruck_model.deep.arguments import Arguments
from deeptruck_model.deep.evaluation import Trials
from deeptruck_model.deep.report import LABELS
from deeptruck_model.deep.truck import DeepTruck
from deeptruck_model.recordings import Recording
from deeptruck_model.signals import CHANNELS, SPEED, printed
from deeptruck_model.simulators import Simulator, free_run

Row = tuple[str, dict[str, Any]]
STEPS = 100  # K


def sample_trials(truck: Simulator, test: Recording) -> Trials:
    """One run of 200 s, initialised once."""
    piece = test.piece(3000, 5001)
    modelled = free_run(truck, piece.u[None], piece.w[None], piece.y[:1]).y
    return Trials(piece.u[None], piece.w[None], piece.y[None], modelled, truck.dt, truck.interface.y)


def sample_run(truck: DeepTruck, test: Recording, path: Path) -> None:
    """Figure of one run of 200 s and its error."""
    runs = sample_trials(truck, test)
    figure = Figure(figsize=(9, 7), layout="constrained")
    axes = figure.subplots(len(runs.channels), 2, sharex=True)
    for j, name in enumerate(runs.channels):
        axes[j, 0].plot(runs.time, runs.measured[0, :, j], "k", lw=1, label="truck")
        axes[j, 0].plot(runs.time, runs.modelled[0, :, j], "tab:red", lw=1, label="model")
        axes[j, 1].plot(runs.time, runs.error[0, :, j], "tab:blue", lw=1)
        axes[j, 0].set_ylabel(f"{LABELS[name]} [{printed(CHANNELS[name].unit)}]")
        axes[j, 1].set_ylabel(f"error [{printed(CHANNELS[name].unit)}]")
    axes[1, 0].legend()
    axes[0, 0].set_title(f"largest speed error {np.abs(runs.error[0, :, SPEED]).max():.2f} m/s")
    for axis in axes[-1]:
        axis.set_xlabel("time [s]")
    figure.savefig(path, dpi=120)


def budget(truck: DeepTruck) -> str:
    """The amount of training, for the reader of a table."""
    config, training = truck.details["config"], truck.details["training"]
    return f"{config['members']} seed(s), {training['updates']} updates each, mode {config['mode']}."


class Column(NamedTuple):
    """One column of a table: a figure of `statistics`."""

    heading: str
    channel: str
    key: str
    form: str = "{:.3f}"
    more_is_better: bool = False


FUEL = Column("fuel rate: mean abs", "fuel_rate", "mean_abs")
LONG_RUNS = (
    Column("speed: sd at end", "speed", "sd_at_end"),
    Column("mean abs", "speed", "mean_abs"),
    Column("within 1.5 m/s", "speed", "trials_within_1.5", "{:.1%}", more_is_better=True),
    Column("acceleration: mean abs", "acceleration", "mean_abs", "{:.4f}"),
    FUEL,
)
SHORT_RUNS = (
    Column("speed: mean abs", "speed", "mean_abs"),
    Column("bias at end", "speed", "mean_at_end"),
    Column("largest", "speed", "largest"),
    Column("acceleration: mean abs", "acceleration", "mean_abs", "{:.4f}"),
    FUEL,
)


def table(
    out: Path, title: str, rows: Sequence[Row], note: str = "", columns: Sequence[Column] = LONG_RUNS
) -> None:
    """Write README.md under `out`: one row of `statistics` for each name."""
    lines = [
        f"# {title}",
        "",
        *([note, ""] if note else []),
        f"| | {' | '.join(column.heading for column in columns)} |",
        "| --- |" + " --- |" * len(columns),
        *(f"| {name} | {' | '.join(_cell(m, column) for column in columns)} |" for name, m in rows),
    ]
    out.mkdir(parents=True, exist_ok=True)
    (out / "README.md").write_text("\n".join(lines) + "\n")


def of_seeds(
    members: Sequence[dict[str, Any]], what: str = "", columns: Sequence[Column] = LONG_RUNS
) -> list[Row]:
    """Rows for the best, median and worst of many seeds, each figure by itself."""
    if len(members) < 2:
        return [(f"{what}one seed", m) for m in members]
    found: list[Row] = []
    for name, share in (("best", 0.0), ("median", 0.5), ("worst", 1.0)):
        row: dict[str, Any] = {}
        for column in columns:
            values = [m[column.channel][column.key] for m in members if column.channel in m]
            values.sort(key=abs, reverse=column.more_is_better)
            if values:
                row.setdefault(column.channel, {})[column.key] = values[round(share * (len(values) - 1))]
        found.append((f"{what}{name} of {len(members)} seeds", row))
    return found


def _cell(metrics: dict[str, Any], column: Column) -> str:
    found = metrics.get(column.channel)
    return "" if found is None else column.form.format(found[column.key]).replace("%", " %")


def intervals(held: Mapping[str, Mapping[str, float]]) -> str:
    """A small table: coverage by channel of intervals that were set in several ways."""
    channels = list(next(iter(held.values())))
    lines = [
        f"| the mean's 90 % intervals hold | {' | '.join(LABELS[name] for name in channels)} |",
        "| --- |" + " --- |" * len(channels),
        *(
            f"| {how} | {' | '.join(f'{100 * shares[name]:.1f} %' for name in channels)} |"
            for how, shares in held.items()
        ),
    ]
    return "\n".join(lines)


def write(out: Path, metrics: dict[str, Any]) -> dict[str, Any]:
    """Write metrics.json under `out`, with settings that apply unless stated otherwise."""
    out.mkdir(parents=True, exist_ok=True)
    content = {**metrics, "arguments": asdict(Arguments())}
    (out / "metrics.json").write_text(json.dumps(content, indent=1) + "\n")
    return metrics
