"""The output of an experiment: tables, numbers, figures and learning curves."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import torch
from matplotlib.figure import Figure

from deeptruck_model.deep.arguments import PAPER_FUEL, Arguments
from deeptruck_model.deep.data import Scales, Sequences
from deeptruck_model.deep.evaluation import Trials
from deeptruck_model.deep.kernels import loss
from deeptruck_model.deep.network import TruckNetwork
from deeptruck_model.deep.report import LABELS
from deeptruck_model.deep.truck import DeepTruck
from deeptruck_model.pages.style import MODELLED, WIDTH_IN, styled
from deeptruck_model.recordings import Recording
from deeptruck_model.signals import CHANNELS, SPEED, printed
from deeptruck_model.simulators import Simulator, free_run

Row = tuple[str, dict[str, Any]]
COLOURS = {"training": "tab:blue", "deployment": "tab:red"}
STEPS = 100  # K
FED = {"nothing": (), "speed": (1,), "acceleration": (0,), "fuel": (2,), "everything": (0, 1, 2)}


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


class Unseen:
    """Two drives outside the training data, one for each form, as the paper has it.

    `fuel` is the cost of a squared fuel error of 1 (cm^3/s)^2.
    """

    def __init__(self, forced: Recording, free: Recording, fuel: float = PAPER_FUEL) -> None:
        self.drives, self.fuel = {"training": forced, "deployment": free}, fuel

    def losses(self, network: TruckNetwork) -> dict[str, list[float]]:
        """Mean squared error in each form, (members,) each, over windows of K steps from zero state."""
        weight = np.zeros(network.shape.responses + network.shape.auxiliary, np.float32)
        weight[: network.shape.responses] = [1.0, 1.0, self.fuel][: network.shape.responses]
        return {
            form: loss.loss(network, *_windows(network, drive), weight, form).tolist()
            for form, drive in self.drives.items()
        }

    def by_feedback(self, network: TruckNetwork) -> dict[str, list[list[float]]]:
        """Mean squared errors [acceleration, speed, fuel] of each member on the drive of the deployment form,
        by which recorded responses replace the network's own as its input."""
        x, target = _windows(network, self.drives["deployment"])
        width = x.shape[-1]
        inputs = torch.as_tensor(x[0]).transpose(0, 1) * network.scale[:width] + network.mean[:width]
        u, w = inputs[..., : network.shape.controls], inputs[..., network.shape.controls :]
        recorded = torch.as_tensor(target[0]).transpose(0, 1)
        found = {}
        for name, channels in FED.items():
            fed = recorded.clone()
            own = [j for j in range(network.shape.responses) if j not in channels]
            fed[:, 1:, own] = torch.nan
            with torch.no_grad():
                made = network.unfold(u, w, fed, "training")[..., : network.shape.responses]
            found[name] = torch.nanmean((made - recorded[:, 1:]) ** 2, dim=(1, 2)).tolist()
        return found


def _windows(network: TruckNetwork, drive: Recording) -> tuple[Any, Any]:
    scales = Scales(network.mean.numpy(), network.scale.numpy(), network.top_speed)
    starts = np.arange(0, len(drive) - STEPS, STEPS)
    return Sequences.of([drive], scales).gather(np.repeat(starts[None], network.shape.members, axis=0), STEPS)


def figure(curves: Mapping[str, Any]) -> Figure:
    """Figure of both losses over the passes: mean, and the range of the seeds."""
    figure = Figure(figsize=(7, 4), layout="constrained")
    axis, at = figure.subplots(), curves["passes"]
    for form, colour in COLOURS.items():
        losses = np.array(curves[form])
        axis.fill_between(at, losses.min(1), losses.max(1), color=colour, alpha=0.25)
        axis.plot(at, losses.mean(1), color=colour, label=f"{form} form")
    axis.set(xlabel="passes over the training data", ylabel="squared error on an unseen drive", yscale="log")
    seeds = losses.shape[1]
    spread = "one seed" if seeds == 1 else f"mean, min and max of {seeds} seeds"
    axis.set_title(spread, fontsize="small", loc="right")
    axis.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2, fontsize="small", frameon=False)
    return figure


@styled()
def error_bands(seeds: Sequence[Mapping[str, Any]]) -> Figure:
    """Figure of the errors against time, one panel for each channel: the median over the seeds of the mean
    error, and the ranges over the seeds of the mean and of the mean plus and minus a standard deviation."""
    time, names = seeds[0]["time"], list(seeds[0]["channels"])
    of = "one seed" if len(seeds) == 1 else f"{len(seeds)} seeds"
    figure = Figure(figsize=(WIDTH_IN, 0.6 + 1.6 * len(names)))
    axes = figure.subplots(len(names), 1, sharex=True, squeeze=False)[:, 0]
    for axis, name in zip(axes, names, strict=True):
        mean, sd = (np.array([seed["channels"][name][part] for seed in seeds]) for part in ("mean", "sd"))
        wide = ((mean - sd).min(axis=0), (mean + sd).max(axis=0))
        axis.fill_between(time, *wide, color=MODELLED, alpha=0.2, lw=0, label="means ± sd")
        axis.fill_between(
            time, mean.min(axis=0), mean.max(axis=0), color=MODELLED, alpha=0.45, lw=0, label="means"
        )
        axis.plot(time, np.median(mean, axis=0), color=MODELLED, label=f"median of {of}")
        axis.axhline(0, color="0.6", lw=0.5)
        axis.set_ylabel(f"{LABELS[name]}\n[{printed(CHANNELS[name].unit)}]")
    axes[0].legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=3)
    axes[-1].set_xlabel("time since the start of the run [s]")
    figure.align_ylabels(axes)
    return figure
