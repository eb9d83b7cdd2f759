"""Trains deep trucks over a grid of settings and seeds, one simulator directory each, and ranks them."""

from __future__ import annotations

import io
import json
import math
import shutil
from collections.abc import Callable, Mapping, Sequence
from contextlib import redirect_stderr
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from deeptruck_core.errors import InputError
from deeptruck_model import recordings, sweeps
from deeptruck_model.checks import MANIFEST, Clock
from deeptruck_model.deep.arguments import OPTIONS, Arguments
from deeptruck_model.results import DEEP_TRUCK, SWEEP

METRICS_FILE = "metrics.json"
RANKED_BY = "speed"  # its mean absolute error in held-out free runs, m/s, mean over the seeds
SHOWN = ("speed", "acceleration")


class Job(NamedTuple):
    """One truck to train; plain values, because a job is sent to another process."""

    bags: tuple[str, ...]
    folder: str
    settings: sweeps.Settings
    topic_map: str | None = None
    clock: Clock | None = None
    msg: tuple[str, ...] = ()


def sweep(
    bags: Sequence[str | Path],
    out: str | Path,
    grid: Mapping[str, Sequence[Any]],
    *,
    seeds: int = 1,
    workers: int = 1,
    engine: str = "processes",
    topic_map: str | Path | None = None,
    clock: Clock | None = None,
    msg: Sequence[str | Path] = (),
    resumes: bool = False,
    overwrite: bool = False,
    say: Callable[[str], None] = lambda line: None,
) -> list[dict[str, Any]]:
    """Train every combination of `grid` (command-line setting: values) with seeds 0 to `seeds` - 1; returns
    one row per combination, the best on held-out data first.

    The trucks are `out`/SETTINGS/seed-N; `out` also gets sweep.json and sweep.md, both at the end. With
    `resumes` a killed sweep continues, and a finished one can be extended by settings or seeds: finished
    trucks are not trained again, also after a worker was killed. `overwrite` starts again. The workers of a
    Ray cluster need access to `bags`, `out` and `topic_map`, which like `clock` is that of `recordings.read`.
    Raises InputError for an unknown setting or value, or data that cannot be trained on.
    """
    chosen = combinations(grid)
    out = Path(out).absolute()
    if not resumes:
        SWEEP.check_start(out, overwrite=overwrite)
    paths = tuple(str(Path(bag).resolve()) for bag in bags)
    goes_on = resumes and SWEEP.marked(out)
    definitions = tuple(str(Path(file).resolve()) for file in msg)
    by_map = None if topic_map is None else str(Path(topic_map).resolve())
    with SWEEP.going_on(out, overwrite=overwrite or goes_on, resume=resumes) as draft:
        if resumes:
            _take_over(out, draft)
        jobs = [
            Job(
                paths,
                str(_folder(draft, settings, seed)),
                {**settings, "seed": seed},
                by_map,
                clock,
                definitions,
            )
            for seed in range(seeds)
            for settings in chosen
        ]
        for number, line in enumerate(sweeps.run(train_one, jobs, workers=workers, engine=engine), 1):
            say(f"{number} of {len(jobs)}: {line.replace(str(draft), str(out), 1)}")
        rows = sorted((_row(draft, out, settings, seeds) for settings in chosen), key=_rank)
        (draft / "sweep.json").write_text(json.dumps(rows, indent=1) + "\n")
        (draft / "sweep.md").write_text(_table(rows))
    return rows


def combinations(grid: Mapping[str, Sequence[Any]]) -> list[sweeps.Settings]:
    """Every combination of one value per setting. Raises InputError for an invalid setting."""
    if "seed" in grid:
        raise InputError("the seeds are counted by --seeds, not set")
    chosen = list(sweeps.combinations(grid, Arguments, "the deep truck", OPTIONS))
    for settings in chosen:
        arguments_of(settings)
    return chosen


def _folder(sweep_folder: Path, settings: sweeps.Settings, seed: int) -> Path:
    return sweep_folder / sweeps.name(settings) / f"seed-{seed}"


def _take_over(finished: Path, draft: Path) -> None:
    """Copy the trucks of a finished sweep into the draft, each completely or not at all."""
    for manifest in finished.glob(f"*/seed-*/{MANIFEST}"):
        place = draft / manifest.parent.relative_to(finished)
        if not (place / MANIFEST).exists():
            with DEEP_TRUCK.replacing(place) as copy:
                shutil.copytree(manifest.parent, copy, dirs_exist_ok=True)


def train_one(job: Job) -> str:
    """Train or continue a job's truck, in any process; returns its folder, and the error if there is no
    truck."""
    from deeptruck_model.deep.training import DivergedError, train

    drives = recordings.read_all(job.bags, topic_map=job.topic_map, clock=job.clock, msg=job.msg)
    with redirect_stderr(io.StringIO()):  # progress bars of several workers would overwrite each other
        try:
            train(drives, Path(job.folder), arguments_of(job.settings), resumes=True)
        except DivergedError:  # that is this setting's result; the others are still worth having
            return f"{job.folder} diverged"
    return job.folder


def arguments_of(settings: sweeps.Settings) -> Arguments:
    """`Arguments` of settings named as on the command line."""
    fields = {option: field for field, option in OPTIONS.items()}
    return Arguments(**{fields.get(name, name): value for name, value in settings.items()})


def _row(draft: Path, out: Path, settings: sweeps.Settings, seeds: int) -> dict[str, Any]:
    """One row of the ranking; the trucks are still in the draft of `out`."""
    folders = [_folder(draft, settings, seed) for seed in range(seeds)]
    trained = [folder for folder in folders if (folder / MANIFEST).exists()]
    metrics = [_metrics(folder) for folder in trained]
    held_out = {name: [m[name]["mean_abs"] for m in metrics if name in m] for name in SHOWN}
    best = trained[int(np.argmin(held_out[RANKED_BY]))] if trained else None
    diverged = len(folders) - len(trained)
    return {
        "settings": settings,
        "held_out_mean_abs": held_out,
        "diverged": diverged,
        "best": best and str(out / best.relative_to(draft)),
    }


def _metrics(folder: Path) -> dict[str, Any]:
    try:
        found: dict[str, Any] = json.loads((folder / METRICS_FILE).read_text())
    except (OSError, ValueError):
        raise InputError(
            f"{folder} has lost its {METRICS_FILE}, by which it is ranked; restore that file, or remove "
            "that folder and sweep again"
        ) from None
    return found


def _rank(row: dict[str, Any]) -> tuple[int, float]:
    """Sort key: settings without diverged seeds first, then by error."""
    errors = row["held_out_mean_abs"][RANKED_BY]
    mean = float(np.mean(errors)) if errors else math.inf
    return row["diverged"], mean if math.isfinite(mean) else math.inf


def _table(rows: Sequence[dict[str, Any]]) -> str:
    """Held-out mean absolute errors, as min / median / max over the seeds."""
    head = "| settings | speed error, m/s: min / median / max | acceleration error, m/s² |"
    lines = [head, "| --- | --- | --- |"]
    for row in rows:
        errors = [row["held_out_mean_abs"][name] for name in SHOWN]
        cells = [" / ".join(f"{x:.3f}" for x in np.quantile(e, (0.0, 0.5, 1.0))) if e else "" for e in errors]
        if row["diverged"]:
            cells[0] = f"{cells[0]} {row['diverged']} diverged".lstrip()
        lines.append(f"| {sweeps.name(row['settings'])} | " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"
