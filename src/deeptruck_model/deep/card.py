"""The last step of training and of calibrating: statistics, card, and the finished directory in place."""

from __future__ import annotations

import json
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path

from deeptruck_model import simulators
from deeptruck_model.deep import checkpoint, evaluation, model_card, reference, resume
from deeptruck_model.deep.truck import DeepTruck
from deeptruck_model.deep.uncertainty import calibrate
from deeptruck_model.errors import InputError
from deeptruck_model.recordings import Recording

METRICS_FILE = "metrics.json"


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
    (working / METRICS_FILE).write_text(json.dumps(metrics, indent=1) + "\n")
    (working / model_card.FILE).write_text(model_card.written(truck, training, validation, metrics))
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


def publish_calibrated(truck: DeepTruck, recordings: Sequence[Recording], source: Path, out: Path) -> None:
    """Write `out`: `source` with the intervals of `truck`, which `recordings` set, and its card and metrics.

    The errors in them stay right: only the intervals are others.
    """
    with checkpoint.replacing(out.resolve()) as folder:
        checkpoint.write(truck, folder)
        if (source / METRICS_FILE).exists():
            shutil.copyfile(source / METRICS_FILE, folder / METRICS_FILE)
        (folder / model_card.FILE).write_text(model_card.with_intervals(source, recordings))
