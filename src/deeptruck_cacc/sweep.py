"""Train over a grid of settings and seeds, in processes or on a Ray cluster, and rank what comes out."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from deeptruck_cacc.policy import read_manifest
from deeptruck_model import sweeps
from deeptruck_model.errors import InputError
from deeptruck_model.sweeps import Settings

TRAINERS = ("analytic", "trpo")


def sweep(
    simulator: str,
    out: str | Path,
    grid: Mapping[str, Sequence[Any]],
    *,
    trainer: str = "analytic",
    workers: int = 1,
    engine: str = "processes",
    tell: Callable[[str], None] = lambda line: None,
) -> list[dict[str, Any]]:
    """Train every combination of `grid` (setting: values) into a folder of its own; best validation first.

    Writes `out`/sweep.json and sweep.md. `simulator` is a path for simulators.load, which every worker must
    reach. A killed sweep goes on where it stopped, and so does a combination whose worker was killed; see
    `sweeps.run` for `workers` and `engine`. Raises InputError for an unknown setting or value, or without Ray
    where it is asked for.
    """
    if trainer not in TRAINERS:
        raise InputError(f"there is no trainer '{trainer}'; known: {', '.join(TRAINERS)}")
    out = Path(out).resolve()
    if out.exists() and not out.is_dir():
        raise InputError(f"{out} is a file; give a folder for the policies")
    chosen = list(sweeps.combinations(grid, _config(trainer), f"the {trainer} trainer"))
    for settings in chosen:
        _config(trainer)(**settings)  # each is refused before the first is trained
    jobs = [(simulator, str(out / sweeps.name(settings)), trainer, settings) for settings in chosen]
    for done in sweeps.run(_train, jobs, workers=workers, engine=engine):
        tell(f"{done}: trained")
    rows = [_row(Path(folder), settings) for _, folder, _, settings in jobs]
    rows.sort(key=lambda row: float(row["score"]))
    out.mkdir(parents=True, exist_ok=True)
    (out / "sweep.json").write_text(json.dumps(rows, indent=1) + "\n")
    (out / "sweep.md").write_text(_table(rows))
    return rows


def _config(trainer: str) -> Any:
    if trainer == "analytic":
        from deeptruck_cacc.training.analytic import AnalyticConfig

        return AnalyticConfig
    from deeptruck_cacc.training.trpo_seeds import TrpoSeedsConfig

    return TrpoSeedsConfig


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
    lines += [f"| {sweeps.name(row['settings'])} | {row['score']:.4f} | {row['worst']:.4f} |" for row in rows]
    return "\n".join(lines) + "\n"
