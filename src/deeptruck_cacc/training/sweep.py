"""Trains policies over a grid of settings and seeds, in processes or on a Ray cluster, and ranks them."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from deeptruck_cacc import training
from deeptruck_cacc.controllers.loading import read_manifest
from deeptruck_cacc.training.settings import AnalyticConfig, TrpoConfig
from deeptruck_core import files
from deeptruck_core.errors import InputError
from deeptruck_model import checks, sweeps
from deeptruck_model.sweeps import Settings

CONFIGS = {"analytic": AnalyticConfig, "trpo": TrpoConfig}
TABLE, ROWS = "sweep.md", "sweep.json"
SWEEP = files.Result("a sweep of policies")


def sweep(
    simulator: str,
    out: str | Path,
    grid: Mapping[str, Sequence[Any]],
    *,
    trainer: str = "analytic",
    workers: int = 1,
    engine: str = "processes",
    resume: bool = False,
    overwrite: bool = False,
    say: Callable[[str], None] = lambda line: None,
) -> list[dict[str, Any]]:
    """Train every combination of `grid` (setting: values) into its own folder; best validation first.

    Writes `out`/sweep.json and sweep.md. `simulator` is a path for simulators.load that every worker can
    access. An interrupted sweep leaves `files.unfinished(out)`, which `resume` continues; a combination whose
    worker was killed is continued automatically; see `sweeps.run` for `workers` and `engine`. Raises
    InputError as `check` does, and if Ray is selected but not installed.
    """
    out = Path(out).absolute()
    chosen = check(simulator, out, grid, trainer=trainer, resume=resume, overwrite=overwrite)
    with SWEEP.going_on(out, overwrite=overwrite, resume=resume) as draft:
        jobs = [(simulator, str(draft / name), trainer, settings) for name, settings in chosen.items()]
        for name in sweeps.run(_train, jobs, workers=workers, engine=engine):
            say(f"{name}: trained")
        rows = [_row(draft / name, out / name, settings) for name, settings in chosen.items()]
        rows.sort(key=lambda row: float(row["score"]))
        files.write(draft / ROWS, (json.dumps(rows, indent=1) + "\n").encode())
        files.write(draft / TABLE, _table(rows).encode())
    return rows


def check(
    simulator: str,
    out: Path,
    grid: Mapping[str, Sequence[Any]],
    *,
    trainer: str = "analytic",
    resume: bool = False,
    overwrite: bool = False,
) -> dict[str, Settings]:
    """The settings to train, by folder name; called before anything is loaded, without torch.

    Raises InputError for an unknown trainer, setting or value (all of them in one line), an older sweep
    without `overwrite`, and an unfinished one without `resume` or `overwrite`, or of another simulator.
    """
    chosen, draft = combinations(trainer, grid), files.unfinished(out)
    SWEEP.check_start(out, resume=resume, overwrite=overwrite)
    for name, settings in chosen.items() if resume else ():
        config = CONFIGS[trainer](**settings)
        training.check(draft / name, trainer=trainer, config=config, source=simulator, resume=True)
    return chosen


def combinations(trainer: str, grid: Mapping[str, Sequence[Any]]) -> dict[str, Settings]:
    """All combinations of one value for each setting, by name. Raises InputError that lists every
    impossible one."""
    if trainer not in CONFIGS:
        raise InputError(f"there is no trainer '{trainer}'; known: {', '.join(CONFIGS)}")
    config, whose = CONFIGS[trainer], f"the {trainer} trainer"
    checks.every(*(partial(_each, trainer, {name: values}) for name, values in grid.items()))
    chosen = list(sweeps.combinations(grid, config, whose))
    return {sweeps.name(settings): settings for settings in chosen}


def _each(trainer: str, grid: Mapping[str, Sequence[Any]]) -> None:
    for settings in sweeps.combinations(grid, CONFIGS[trainer], f"the {trainer} trainer"):
        CONFIGS[trainer](**settings)


def _train(job: tuple[str, str, str, Settings]) -> str:
    """Run one job, in any process; returns the name of its folder."""
    import torch

    from deeptruck_model import simulators

    torch.set_num_threads(1)
    simulator, folder, trainer, settings = job
    config = CONFIGS[trainer](**settings)
    if not training.check(Path(folder), trainer=trainer, config=config, source=simulator, resume=True):
        truck = simulators.load(simulator)
        training.train(truck, folder, trainer=trainer, config=config, resume=True, source=simulator)
    return Path(folder).name


def _row(folder: Path, final: Path, settings: Settings) -> dict[str, Any]:
    seeds = sorted((folder / "seeds").glob("*/policy.json"))
    scores = [float(read_manifest(path.parent)["card"]["validation"]["score"]) for path in seeds]
    return {"settings": settings, "score": min(scores), "worst": max(scores), "policy": str(final)}


def _table(rows: list[dict[str, Any]]) -> str:
    lines = ["| settings | validation, best seed | worst seed |", "|---|---|---|"]
    lines += [f"| {sweeps.name(row['settings'])} | {row['score']:.4f} | {row['worst']:.4f} |" for row in rows]
    return "\n".join(lines) + "\n"
