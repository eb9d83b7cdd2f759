"""Pictures that only the demo draws; the others come from the commands it runs."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from deeptruck_model.recordings import Recording
from deeptruck_model.signals import printed
from examples.demo.following import Following

BLUE, RED, GREY = "tab:blue", "tab:red", "0.45"


def recording_figure(drive: Recording, shown_s: float = 900.0) -> Figure:
    """The first quarter of an hour of a drive, channel under channel."""
    piece = drive.piece(0, min(len(drive), round(shown_s / drive.dt)))
    minutes = (piece.time - piece.start_s) / 60
    engine, brake = (printed(drive.interface.unit(name)) for name in ("engine_command", "brake_command"))
    rows = (
        ("speed", 1.0, "speed\n[m/s]"),
        ("acceleration", 1.0, "acceleration\n[m/s²]"),
        ("engine_command", 1.0, f"engine command\n[{engine}]"),
        ("brake_command", 1.0, f"brake command\n[{brake}]"),
        ("gear", 1.0, "gear"),
        ("grade", 100.0, "grade\n[%]"),
        ("fuel_rate", 1.0, "fuel rate\n[cm³/s]"),
    )
    figure = Figure(figsize=(11, 11), layout="constrained")  # so high that the labels do not touch
    axes = figure.subplots(len(rows), 1, sharex=True)
    for axis, (name, scale, label) in zip(axes, rows, strict=True):
        axis.plot(minutes, scale * piece.channels[name], lw=0.8, color=BLUE)
        axis.set_ylabel(label)
        axis.margins(x=0)
    axes[-1].set_xlabel("time [min]")
    figure.align_ylabels(axes)
    return figure


def learning_figure(simulator: Path, policy: Path) -> Figure:
    """Losses of the deep truck (from its TensorBoard log) and of the policy against the updates."""
    figure = Figure(figsize=(11, 3.6), layout="constrained")
    truck, follower = figure.subplots(1, 2)
    for name, points in truck_curves(simulator).items():
        truck.semilogy(*zip(*points, strict=True), label=name)
    truck.set(xlabel="updates", ylabel="loss")
    rows = [json.loads(line) for line in (policy / "learning_curve.jsonl").read_text().splitlines()]
    steps = np.array([row["iteration"] for row in rows])
    follower.semilogy(steps, [np.mean(row["cost"]) for row in rows], label="cost", lw=0.8)
    judged = [(row["iteration"], np.min(row["validation"])) for row in rows if "validation" in row]
    follower.semilogy(*zip(*judged, strict=True), "o-", label="validation, fresh scenes")
    follower.set(xlabel="updates", ylabel="cost of a step")
    for axis, title in ((truck, "deep truck"), (follower, "policy")):
        axis.set_title(title, loc="left")
        axis.legend(
            ncols=2, loc="lower right", bbox_to_anchor=(1.0, 1.0), frameon=False
        )  # no curve runs there
        axis.xaxis.set_major_locator(MaxNLocator(integer=True))
        axis.grid(alpha=0.3)
    return figure


def truck_curves(simulator: Path) -> dict[str, list[tuple[int, float]]]:
    """(update, loss) of training and validation, as the trainer logged them."""
    from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

    events = EventAccumulator(str(simulator / "tensorboard")).Reload()
    names = ("training", "validation")
    return {name: [(e.step, e.value) for e in events.Scalars(f"loss/{name}")] for name in names}


def following_figure(runs: list[Following]) -> Figure:
    """The closed-loop runs side by side, one column each, on the same axes.

    Time is the first run's: a bag may begin before or after its leader, so the others are moved until their
    leaders first change speed when its leader does.
    """
    figure = Figure(figsize=(6.2 * len(runs), 9.5), layout="constrained")
    axes = figure.subplots(5, len(runs), sharex=True, sharey="row", squeeze=False)
    for column, run in enumerate(runs):
        _follow(axes[:, column], run, _delay(runs[0], run))
        axes[0, column].set_title(run.title)
        axes[-1, column].set_xlabel("time [s]")
    labels = ("speed\n[m/s]", "gap\n[m]", "acceleration\n[m/s²]", "engine\n[N m]", "brake\n[%]")
    for row, label in enumerate(labels):
        axes[row, 0].set_ylabel(label)
    axes[0, 0].legend(ncols=2)
    axes[1, 0].legend()
    return figure


def _delay(first: Following, run: Following) -> float:
    """By how much a run's leader moves earlier than the first one's, s."""
    moves = first.leader_moves_s, run.leader_moves_s
    return 0.0 if moves[0] is None or moves[1] is None else moves[0] - moves[1]


def _follow(axes: Any, run: Following, delay: float) -> None:
    t, c = run.time + delay, run.channels
    axes[0].plot(t, c["leader_speed"], color="k", lw=1, label="leader, by radar")
    axes[0].plot(t, c["speed"], color=RED, lw=1.2, label="truck")
    axes[1].plot(t, c["gap"], color="k", lw=1, label="by radar")
    axes[1].plot(t, run.target_gap, color=RED, lw=1.2, label=f"wanted: {run.time_gap:g} s of its speed")
    axes[2].plot(t, c["acceleration"], color=BLUE, lw=1)
    axes[3].plot(t, c["engine_command"], color=BLUE, lw=1)
    axes[4].plot(t, c["brake_command"], color=BLUE, lw=1)
    for axis in axes:
        axis.grid(alpha=0.3)
        axis.margins(x=0)
        if run.another_s is not None:
            axis.axvspan(*(delay + s for s in run.another_s), color="0.85", lw=0)
    axes[1].set_ylim(bottom=0)
