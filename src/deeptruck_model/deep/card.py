"""The last step of training and of calibration: statistics, MODEL_CARD.md, and the finished directory."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from deeptruck_core.signals import printed
from deeptruck_model import simulators
from deeptruck_model.deep import evaluation, io, resume
from deeptruck_model.deep.evaluation import calibrate
from deeptruck_model.deep.truck import DeepTruck
from deeptruck_model.recordings import Recording
from deeptruck_model.results import CALIBRATED

METRICS_FILE = io.METRICS_FILE
FILE = "MODEL_CARD.md"
CARD = """# Deep truck{name}

Trained for {updates} updates on {hours:.2f} h, mode {mode}, seeds {seeds}{adapted}.

Recordings, with the later part that was held out: {recordings}.

## Signals

| channel | unit | role | trained from | to |
| --- | --- | --- | --- | --- |
{signals}

Step {dt:g} s. Counts over speed x acceleration x grade are in `coverage.json`.

## Held out

{trials} free runs of {horizon:.0f} s on the later part of the recordings. That part selected the checkpoint:
expect somewhat more on other drives.

| channel | mean abs error | mean | sd at end | rmse at end |
| --- | --- | --- | --- | --- |
{errors}

## Intervals

{intervals}

## Limits

{limits}
"""
INTERVALS = re.compile(r"(?<=^## Intervals\n\n).*?(?=\n\n## |\Z)", re.M | re.S)
BY_TRAINING = (
    "The held-out part above sets the 90 % intervals; `deeptruck-model calibrate` sets them by other drives."
)
LISTED = 20  # recordings named in the card


def git_hash() -> str | None:
    """Commit of the source checkout in use; None outside a checkout."""
    try:
        found = subprocess.run(
            ["git", "rev-parse", "HEAD"],
            cwd=Path(__file__).parent,
            capture_output=True,
            text=True,
            timeout=5,
            check=True,
        )
    except (OSError, subprocess.SubprocessError):
        return None
    return found.stdout.strip()


def complete(
    truck: DeepTruck, training: Sequence[Recording], validation: Sequence[Recording], working: Path
) -> None:
    """Write all files of a simulator directory into `working`, and set the intervals of `truck`.

    The resume point is removed last, so that the work can be continued until then.
    """
    io.write(truck, working)
    again = simulators.load(working)
    assert isinstance(again, DeepTruck)
    truck.details["calibration"] = calibrate(again, validation)
    metrics = evaluation.statistics(evaluation.trials(again, validation))
    (working / METRICS_FILE).write_text(json.dumps(metrics, indent=1) + "\n")
    (working / FILE).write_text(written(truck, training, validation, metrics))
    io.save_reference(validation, working)
    io.write(truck, working, (METRICS_FILE, io.REFERENCE_FILE))
    (working / resume.FILE).unlink(missing_ok=True)


def lost_metrics(source: Path) -> str:
    """One line if a simulator has lost its metrics; else none. Trucks that never had metrics are not
    reported."""
    if (source / METRICS_FILE).exists():
        return ""
    promised = METRICS_FILE in io.promised(simulators.read_manifest(source))
    return f"{source} has lost its {METRICS_FILE}, so there is none beside the intervals" if promised else ""


def publish_calibrated(
    truck: DeepTruck, recordings: Sequence[Recording], source: Path, out: Path, overwrite: bool = False
) -> None:
    """Write `out`: `source` with the intervals of `truck`, which were calibrated on `recordings`, and its
    card and metrics.

    The errors in these remain valid, because only the intervals change.
    """
    with CALIBRATED.replacing(out, overwrite=overwrite) as folder:
        metrics = [METRICS_FILE] if (source / METRICS_FILE).exists() else []
        for name in metrics:
            shutil.copyfile(source / name, folder / name)
        io.write(truck, folder, metrics)
        (folder / FILE).write_text(with_intervals(source, recordings))


def with_intervals(source: Path, recordings: Sequence[Recording]) -> str:
    """The card in `source`, with a section on the recordings that set the intervals; older versions wrote
    cards without it."""
    says = f"The 90 % intervals were set by `deeptruck-model calibrate` on {listed(recordings)}."
    path = source / FILE
    card = path.read_text() if path.exists() else f"# Deep truck: {source.name}\n"
    if INTERVALS.search(card):
        return INTERVALS.sub(lambda _: says, card)
    return f"{card.rstrip()}\n\n## Intervals\n\n{says}\n"


def listed(recordings: Sequence[Recording]) -> str:
    """Names and lengths of recordings, with the pieces of one bag combined."""
    hours: dict[str, float] = {}
    for r in recordings:
        name = r.name.partition("#")[0]
        hours[name] = hours.get(name, 0.0) + len(r) * r.dt / 3600
    named = [f"{name} ({h:.2f} h)" for name, h in hours.items()]
    more = f" and {len(named) - LISTED} more" if len(named) > LISTED else ""
    return ", ".join(named[:LISTED]) + more


def written(
    truck: DeepTruck,
    training: Sequence[Recording],
    validation: Sequence[Recording],
    metrics: dict[str, Any],
) -> str:
    """The model card: what the truck was trained on, its errors on held-out data, and where its predictions
    are not reliable."""
    interface, run, config = truck.interface, truck.details["training"], truck.details["config"]
    seeds = ", ".join(map(str, truck.details["seeds"]))
    signals = [
        f"| {name} | {printed(interface.unit(name))} | {role} | {np.nanmin(x):.4g} | {np.nanmax(x):.4g} |"
        for role, names in (("input", interface.u), ("condition", interface.w), ("response", interface.y))
        for name in names
        for x in [np.concatenate([r.channels[name] for r in training])]
    ]
    errors = [
        f"| {name} ({printed(interface.unit(name))}) | "
        + " | ".join(
            "not measured" if (value := metrics[name][key]) is None else f"{value:.4f}"
            for key in ("mean_abs", "mean", "sd_at_end", "rmse_at_end")
        )
        + " |"
        for name in interface.y
        if name in metrics
    ]
    return CARD.format(
        name="" if training[0].from_table else f": {interface.name}",  # a table's is that of its file
        updates=run["updates"],
        hours=run["hours"],
        mode=config["mode"],
        seeds=seeds,
        adapted=f", adapted from {config['start']}" if config["start"] else "",
        recordings=listed([*training, *validation]),
        intervals=BY_TRAINING,
        signals="\n".join(signals),
        dt=truck.dt,
        trials=metrics["trials"],
        horizon=metrics["horizon_s"],
        errors="\n".join(errors),
        limits="\n".join(f"- {limit}" for limit in _limits(truck)),
    )


def _limits(truck: DeepTruck) -> list[str]:
    limits = ["It knows nothing outside the spans above; `DeepTruck.covers` says where that is."]
    limits.append(
        "The internal state (gear, boost) is unknown at the start of a run and settles within seconds."
    )
    unexcited = truck.details["training"].get("unexcited", ())
    limits += [f"{line[0].upper()}{line[1:]}." for line in unexcited]
    if truck.interface.brake_unit is None:
        share = 100 * truck.details["training"]["unexplained"]
        limits.append(f"Of the rows {share:.1f} %, slowed by unrecorded braking, are left out.")
    if not truck.interface.grade:
        limits.append("Grade was not recorded: the road acts as an unexplained force.")
    if truck.details["training"]["hours"] < 1.0:
        limits.append("Trained on less than an hour of driving.")
    return limits
