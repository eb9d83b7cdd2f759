"""Pictures that only the demo draws; the others come from the commands it runs."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from deeptruck_core.pages.style import GUIDE, MODELLED, RECORDED, WIDTH_IN, plain_log, styled
from examples.demo.following import Following

FOUND = "#D55E00"
RUNS = (MODELLED, FOUND)
ANOTHER_S = (63.0, 65.0)  # when the radar sees another vehicle: `--radar field`


@styled()
def hidden_figure(
    time: NDArray[np.float64], force: NDArray[np.float64], segments: Sequence[Mapping[str, Any]]
) -> Figure:
    """The hidden force (n,) in N over a drive, and the mean of each segment that the tool found in it."""
    figure = Figure(figsize=(WIDTH_IN, 2.6))
    axis = figure.subplots()
    axis.plot(time, force / 1000.0, color=RECORDED, label="hidden")
    label: str | None = "found: mean of each segment"
    for s in segments:
        if s["mean_force_n"] is not None:
            axis.plot(
                (s["start_s"], s["end_s"]), [s["mean_force_n"] / 1000.0] * 2, color=FOUND, lw=4, label=label
            )
            label = None
    axis.set(xlabel="time [s]", ylabel="force [kN]")
    axis.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2)
    axis.margins(x=0)
    return figure


@styled()
def learning_figure(simulator: Path, policy: Path) -> Figure:
    """Losses of the deep truck (from its TensorBoard log) and of the policy against the updates."""
    figure = Figure(figsize=(WIDTH_IN, 5.2))
    truck, follower = figure.subplots(2, 1)
    for name, points in truck_curves(simulator).items():
        truck.semilogy(*zip(*points, strict=True), label=name)
    truck.set(title="deep truck", ylabel="loss")
    rows = [json.loads(line) for line in (policy / "learning_curve.jsonl").read_text().splitlines()]
    steps = np.array([row["iteration"] for row in rows])
    follower.semilogy(steps, [np.mean(row["cost"]) for row in rows], label="cost", lw=0.8)
    judged = [(row["iteration"], np.min(row["validation"])) for row in rows if "validation" in row]
    follower.semilogy(*zip(*judged, strict=True), "o-", label="validation, fresh scenes")
    follower.set(title="policy", xlabel="updates", ylabel="cost of a step")
    for axis in (truck, follower):
        axis.legend(ncols=2, loc="lower right", bbox_to_anchor=(1.0, 1.0))  # no curve runs there
        plain_log(axis.yaxis)
        axis.xaxis.set_major_locator(MaxNLocator(integer=True))
    return figure


def truck_curves(simulator: Path) -> dict[str, list[tuple[int, float]]]:
    """(update, loss) of training and validation, as the trainer logged them."""
    from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

    events = EventAccumulator(str(simulator / "tensorboard")).Reload()
    names = ("training", "validation")
    return {name: [(e.step, e.value) for e in events.Scalars(f"loss/{name}")] for name in names}


@styled()
def following_figure(runs: Sequence[Following]) -> Figure:
    """The closed-loop runs over each other."""
    figure = Figure(figsize=(WIDTH_IN, 6.6))
    axes = figure.subplots(4, 1, sharex=True)
    for run, colour in zip(runs, RUNS, strict=False):
        _follow(axes, run, colour, first=run is runs[0])
    for axis, label in zip(
        axes, ("speed\n[m/s]", "time gap\n[s]", "engine\n[N m]", "brake\n[%]"), strict=True
    ):
        axis.set_ylabel(label)
        axis.margins(x=0)
    axes[-1].set_xlabel("time [s]")
    axes[0].legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=3)
    figure.align_ylabels(axes)
    return figure


def _follow(axes: Any, run: Following, colour: str, *, first: bool) -> None:
    t, c = run.time, run.channels
    if first:
        axes[0].plot(t, run.true_leader_speed, color=RECORDED, label="leader")
        axes[1].axhline(run.time_gap, color=GUIDE)
        for axis in axes:
            axis.axvspan(*ANOTHER_S, color="0.85", lw=0)
    axes[0].plot(t, c["speed"], color=colour, label=run.title)
    axes[1].plot(t, run.true_gap / np.maximum(c["speed"], 1.0), color=colour)
    axes[2].plot(t, c["engine_command"], color=colour)
    axes[3].plot(t, c["brake_command"], color=colour)
