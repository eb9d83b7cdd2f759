"""Train over a grid of settings and seeds, in processes or on a Ray cluster, and rank what comes out."""

from __future__ import annotations

import json
import multiprocessing
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import fields
from itertools import product
from pathlib import Path
from typing import Any

from deeptruck_cacc.policy import read_manifest
from deeptruck_model.errors import InputError

Settings = dict[str, Any]
TRAINERS = ("analytic", "trpo")


def sweep(
    simulator: str,
    out: str | Path,
    grid: Mapping[str, Sequence[Any]],
    *,
    trainer: str = "analytic",
    workers: int = 1,
    ray: bool = False,
    tell: Callable[[str], None] = lambda line: None,
) -> list[dict[str, Any]]:
    """Train every combination of `grid` (setting: values) into a folder of its own; best validation first.

    Writes `out`/sweep.json and sweep.md. `simulator` is a path for simulators.load, which every worker must
    reach. A killed sweep goes on where it stopped. With `ray`, workers are those of the cluster that
    RAY_ADDRESS names, or of this machine. Raises InputError for an unknown setting, or without Ray where it
    is asked for.
    """
    out = Path(out)
    jobs = [(simulator, str(out / _name(s)), trainer, s) for s in _combinations(grid, trainer)]
    for done in _map(jobs, workers, ray):
        tell(f"{done}: trained")
    rows = [_row(Path(folder), settings) for _, folder, _, settings in jobs]
    rows.sort(key=lambda row: float(row["score"]))
    out.mkdir(parents=True, exist_ok=True)
    (out / "sweep.json").write_text(json.dumps(rows, indent=1) + "\n")
    (out / "sweep.md").write_text(_table(rows))
    return rows


def read_grid(options: Sequence[str]) -> dict[str, list[Any]]:
    """A grid from options such as 'learning_rate=0.003,0.006'; values as in JSON, else text."""
    grid = {}
    for option in options:
        name, equals, values = option.partition("=")
        if not equals or not values:
            raise InputError(f"'{option}' is no setting; write it as learning_rate=0.003,0.006")
        grid[name] = [_value(text) for text in values.split(",")]
    return grid


def _value(text: str) -> Any:
    try:
        return json.loads(text)
    except json.JSONDecodeError:
        return text


def _combinations(grid: Mapping[str, Sequence[Any]], trainer: str) -> Iterator[Settings]:
    if trainer not in TRAINERS:
        raise InputError(f"there is no trainer '{trainer}'; known: {', '.join(TRAINERS)}")
    known = [f.name for f in fields(_config(trainer))]
    unknown = [name for name in grid if name not in known]
    if unknown:
        raise InputError(f"the {trainer} trainer has no setting '{unknown[0]}'; known: {', '.join(known)}")
    for values in product(*grid.values()):
        yield dict(zip(grid, values, strict=True))


def _config(trainer: str) -> Any:
    if trainer == "analytic":
        from deeptruck_cacc.training.analytic import AnalyticConfig

        return AnalyticConfig
    from deeptruck_cacc.training.trpo_seeds import TrpoSeedsConfig

    return TrpoSeedsConfig


def _name(settings: Settings) -> str:
    return ",".join(f"{name}={value}" for name, value in settings.items()) or "default"


def _map(jobs: Sequence[tuple[str, str, str, Settings]], workers: int, ray: bool) -> Iterator[str]:
    """The folders, as they get done."""
    if not ray and workers == 1:
        yield from map(_train, jobs)
        return
    with _pool(workers, ray) as pool:
        yield from pool.imap_unordered(_train, jobs)


def _pool(workers: int, ray: bool) -> Any:
    if not ray:
        return multiprocessing.get_context("spawn").Pool(workers)
    try:
        from ray.util.multiprocessing import Pool
    except ModuleNotFoundError:
        raise InputError("Ray is not installed: pip install 'deeptruck[ray]', or leave --ray out") from None
    return Pool(workers)


def _train(job: tuple[str, str, str, Settings]) -> str:
    """One job, in whichever process."""
    import torch

    from deeptruck_cacc import training
    from deeptruck_model import simulators

    torch.set_num_threads(1)
    simulator, folder, trainer, settings = job
    truck, config = simulators.load(simulator), _config(trainer)(**settings)
    training.train(truck, folder, trainer=trainer, config=config, resume=True, source=simulator)
    return folder


def _row(folder: Path, settings: Settings) -> dict[str, Any]:
    seeds = sorted((folder / "seeds").glob("*/policy.json"))
    scores = [float(read_manifest(path.parent)["card"]["validation"]["score"]) for path in seeds]
    return {"settings": settings, "score": min(scores), "worst": max(scores), "policy": str(folder)}


def _table(rows: list[dict[str, Any]]) -> str:
    lines = ["| settings | validation, best seed | worst seed |", "|---|---|---|"]
    lines += [f"| {_name(row['settings'])} | {row['score']:.4f} | {row['worst']:.4f} |" for row in rows]
    return "\n".join(lines) + "\n"
