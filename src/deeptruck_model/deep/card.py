"""The last step of training: held-out statistics, calibration, MODEL_CARD.md, and the finished directory in
place."""

from __future__ import annotations

import json
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from deeptruck_model import simulators
from deeptruck_model.deep import checkpoint, evaluation, reference, resume
from deeptruck_model.deep.truck import DeepTruck
from deeptruck_model.deep.uncertainty import calibrate
from deeptruck_model.errors import InputError
from deeptruck_model.recordings import Recording

CARD = """# Deep truck: {name}

Trained for {updates} updates on {hours:.2f} h, mode {mode}, seeds {seeds}.

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

## Limits

{limits}
"""


def git_hash() -> str | None:
    """Commit of the source this runs from; None outside a checkout."""
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


def publish(
    truck: DeepTruck,
    training: Sequence[Recording],
    validation: Sequence[Recording],
    working: Path,
    out: Path,
) -> DeepTruck:
    """Complete `working` into a simulator directory, move it to `out`, and return the truck read back from
    there."""
    checkpoint.write(truck, working)
    again = simulators.load(working)
    assert isinstance(again, DeepTruck)
    truck.details["calibration"] = calibrate(again, validation)
    checkpoint.write(truck, working)
    metrics = evaluation.statistics(evaluation.trials(again, validation))
    (working / "metrics.json").write_text(json.dumps(metrics, indent=1) + "\n")
    (working / "MODEL_CARD.md").write_text(model_card(truck, training, metrics))
    reference.save(validation, working)
    try:
        checkpoint.put(working, out)
    except OSError as error:
        raise InputError(f"cannot write {out}: {error.strerror}; mend that and add --resume") from None
    (out / resume.FILE).unlink(missing_ok=True)  # only now: without it nothing could be gone on with
    shutil.rmtree(working, ignore_errors=True)
    loaded = simulators.load(out)
    assert isinstance(loaded, DeepTruck)
    return loaded


def model_card(truck: DeepTruck, training: Sequence[Recording], metrics: dict[str, Any]) -> str:
    """What the truck was trained on, how far off it is on held-out data, and where not to trust it."""
    interface, run, config = truck.interface, truck.details["training"], truck.details["config"]
    seeds = ", ".join(map(str, truck.details["seeds"]))
    signals = [
        f"| {name} | {interface.unit(name)} | {role} | {low:.4g} | {high:.4g} |"
        for role, names in (("input", interface.u), ("condition", interface.w), ("response", interface.y))
        for name in names
        for low, high in [_span(training, name)]
    ]
    errors = [
        f"| {name} ({interface.unit(name)}) | "
        + " | ".join(_figure(metrics[name][key]) for key in ("mean_abs", "mean", "sd_at_end", "rmse_at_end"))
        + " |"
        for name in interface.y
        if name in metrics
    ]
    return CARD.format(
        name=interface.name,
        updates=run["updates"],
        hours=run["hours"],
        mode=config["mode"],
        seeds=seeds,
        signals="\n".join(signals),
        dt=truck.dt,
        trials=metrics["trials"],
        horizon=metrics["horizon_s"],
        errors="\n".join(errors),
        limits="\n".join(f"- {limit}" for limit in _limits(truck)),
    )


def _figure(value: float | None) -> str:
    return "not measured" if value is None else f"{value:.4f}"


def _span(recordings: Sequence[Recording], name: str) -> tuple[float, float]:
    values = np.concatenate([r.channels[name] for r in recordings])
    return float(np.nanmin(values)), float(np.nanmax(values))


def _limits(truck: DeepTruck) -> list[str]:
    limits = ["It knows nothing outside the spans above; `DeepTruck.covers` tells where that is."]
    limits.append(
        "The internal state (gear, boost) is unknown at the start of a run and settles within seconds."
    )
    if truck.interface.brake_unit is None:
        share = 100 * truck.details["training"]["unexplained"]
        limits.append(f"Braking was not recorded: {share:.1f} % of the rows, slowed by it, are left out.")
    if not truck.interface.grade:
        limits.append("Grade was not recorded: the road acts as an unexplained force.")
    if truck.details["training"]["hours"] < 1.0:
        limits.append("Trained on less than an hour of driving.")
    return limits
