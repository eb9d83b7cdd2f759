"""The last step of training: held-out statistics, calibration, MODEL_CARD.md, and the finished directory in place."""

from __future__ import annotations

import json
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from deeptruck_model import simulators
from deeptruck_model.deep import checkpoint, evaluation, resume
from deeptruck_model.deep.truck import DeepTruck
from deeptruck_model.errors import InputError
from deeptruck_model.recordings import Recording


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
    """Complete `working` into a simulator directory, move it to `out`, and return the truck read back from there."""
    checkpoint.write(truck, working)
    again = simulators.load(working)
    metrics = evaluation.statistics(evaluation.trials(again, validation))
    (working / "metrics.json").write_text(json.dumps(metrics, indent=1) + "\n")
    (working / "MODEL_CARD.md").write_text(model_card(truck, training, metrics))
    (working / resume.FILE).unlink(missing_ok=True)
    try:
        checkpoint.put(working, out)
    except OSError as error:
        raise InputError(f"cannot write {out}: {error.strerror}; the trained truck is in {working}") from None
    shutil.rmtree(working, ignore_errors=True)
    loaded = simulators.load(out)
    assert isinstance(loaded, DeepTruck)
    return loaded


def model_card(truck: DeepTruck, training: Sequence[Recording], metrics: dict[str, Any]) -> str:
    """What the truck was trained on, how far off it is on held-out data, and where not to trust it."""
    interface, details = truck.interface, truck.details
    lines = [f"# Deep truck: {interface.name}", ""]
    lines += [f"Trained for {details['training']['updates']} updates on {details['training']['hours']:.2f} h, "
              f"mode {details['config']['mode']}, seeds {details['seeds']}.", ""]  # fmt: skip
    lines += [
        "## Signals",
        "",
        "| channel | unit | role | trained from | to |",
        "| --- | --- | --- | --- | --- |",
    ]
    for role, names in (("input", interface.u), ("condition", interface.w), ("response", interface.y)):
        for name in names:
            low, high = _span(training, name)
            lines.append(f"| {name} | {interface.unit(name)} | {role} | {low:.4g} | {high:.4g} |")
    lines += ["", f"Step {truck.dt:g} s. Speed x acceleration x grade counts are in `coverage.json`.", ""]
    lines += ["## Held out", "", f"{metrics['trials']} free runs of {metrics['horizon_s']:.0f} s on the later part of the "
              "recordings. This part selected the checkpoint: expect somewhat more on other drives.", ""]  # fmt: skip
    lines += [
        "| channel | mean abs error | mean | sd at end | rmse at end |",
        "| --- | --- | --- | --- | --- |",
    ]
    for name in interface.y:
        if name in metrics:
            m = metrics[name]
            lines.append(
                f"| {name} ({interface.unit(name)}) | {m['mean_abs']:.4f} | {m['mean']:.4f} | {m['sd_at_end']:.4f} "
                f"| {m['rmse_at_end']:.4f} |"
            )
    lines += ["", "## Limits", "", *(f"- {limit}" for limit in _limits(truck)), ""]
    return "\n".join(lines)


def _span(recordings: Sequence[Recording], name: str) -> tuple[float, float]:
    import numpy as np

    values = np.concatenate([r.channels[name] for r in recordings])
    return float(np.nanmin(values)), float(np.nanmax(values))


def _limits(truck: DeepTruck) -> list[str]:
    limits = ["It knows nothing outside the spans above; `DeepTruck.covers` tells where that is."]
    limits.append(
        "The internal state (gear, boost) is unknown at the start of a run and settles within seconds."
    )
    if truck.interface.brake_unit is None:
        limits.append("Braking was not recorded: decelerations by the service brake cannot be predicted.")
    if not truck.interface.grade:
        limits.append("Grade was not recorded: the road acts as an unexplained force.")
    if truck.details["training"]["hours"] < 1.0:
        limits.append("Trained on less than an hour of driving.")
    return limits
