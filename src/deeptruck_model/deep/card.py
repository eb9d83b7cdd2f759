"""The last step of training and of calibrating: statistics, card, and the finished directory in place."""

from __future__ import annotations

import json
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path

from deeptruck_model import simulators
from deeptruck_model.deep import evaluation, model_card, resume, saving
from deeptruck_model.deep.data import reference
from deeptruck_model.deep.truck import DeepTruck
from deeptruck_model.deep.uncertainty import calibrate
from deeptruck_model.recordings import Recording
from deeptruck_model.results import CALIBRATED

METRICS_FILE = saving.METRICS_FILE


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


def complete(
    truck: DeepTruck, training: Sequence[Recording], validation: Sequence[Recording], working: Path
) -> None:
    """Write all files of a simulator directory into `working`, and set the intervals of `truck`.

    The resume point goes last: until then the work can be gone on with.
    """
    saving.write(truck, working)
    again = simulators.load(working)
    assert isinstance(again, DeepTruck)
    truck.details["calibration"] = calibrate(again, validation)
    metrics = evaluation.statistics(evaluation.trials(again, validation))
    (working / METRICS_FILE).write_text(json.dumps(metrics, indent=1) + "\n")
    (working / model_card.FILE).write_text(model_card.written(truck, training, validation, metrics))
    reference.save(validation, working)
    saving.write(truck, working, (METRICS_FILE, reference.FILE))
    (working / resume.FILE).unlink(missing_ok=True)


def lost_metrics(source: Path) -> str:
    """One line where a simulator has lost its metrics; else none. Trucks that never had any are not meant."""
    if (source / METRICS_FILE).exists():
        return ""
    promised = METRICS_FILE in saving.promised(simulators.read_manifest(source))
    return f"{source} has lost its {METRICS_FILE}, so there is none beside the intervals" if promised else ""


def publish_calibrated(
    truck: DeepTruck, recordings: Sequence[Recording], source: Path, out: Path, overwrite: bool = False
) -> None:
    """Write `out`: `source` with the intervals of `truck`, which `recordings` set, and its card and metrics.

    The errors in them stay right: only the intervals are others.
    """
    with CALIBRATED.replacing(out, overwrite=overwrite) as folder:
        metrics = [METRICS_FILE] if (source / METRICS_FILE).exists() else []
        for name in metrics:
            shutil.copyfile(source / name, folder / name)
        saving.write(truck, folder, metrics)
        (folder / model_card.FILE).write_text(model_card.with_intervals(source, recordings))
