"""What the paper says of its models, measured on the reference trucks in three recipes, seed by seed."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from deeptruck_model import files
from deeptruck_model.deep.arguments import Arguments
from deeptruck_model.deep.evaluation import HORIZON_S, TRIALS, Trials, against_time, statistics, trials
from deeptruck_model.deep.experiments.learning_curves import Unseen
from deeptruck_model.deep.experiments.setup import (
    FIELD_RUNS,
    FIELD_S,
    OTHER_SEED,
    PAPER,
    TEST_SEED,
    TRAIN_SEED,
    drive_of,
    field_drives,
    passes,
)
from deeptruck_model.deep.network import TruckNetwork
from deeptruck_model.deep.training import train
from deeptruck_model.deep.truck import DeepTruck
from deeptruck_model.recordings import Recording
from deeptruck_model.signals import SPEED
from deeptruck_model.simulators import free_run

RECIPES: dict[str, Arguments] = {
    "paper": PAPER,
    "default": Arguments(),
    "unaided": Arguments(teach=0.0),
}
TRANSIENT_S = 2.0
SAMPLE = slice(3000, 5001)  # 200 s
BY_FEEDBACK = 6  # rounds from one look at the feedback to the next


class Job(NamedTuple):
    """One truck to learn: where, of which reference truck, by which recipe and seed; updates 0 chooses."""

    work: str
    truck: str
    recipe: str
    seed: int
    updates: int = 0

    @property
    def name(self) -> str:
        return f"{self.truck}-{self.recipe}-{self.seed}"

    @property
    def folder(self) -> Path:
        """The deep truck."""
        return Path(self.work) / "trucks" / self.name


@cache
def drives(truck: str) -> tuple[Recording, Recording]:
    """Training and test drive: 4 h and 3 h of `trucksim`, the paper's field budgets of the others."""
    if truck == "trucksim":
        return drive_of(truck, 240, TRAIN_SEED), drive_of(truck, 180, TEST_SEED)
    return field_drives(truck)


def learn(job: Job) -> dict[str, Any]:
    """Train and measure; what was done before is read. Goes on where it was killed."""
    kept = Path(job.work) / f"{job.name}.json"
    if kept.exists() and (found := json.loads(kept.read_text()))["budget"] == job.updates:
        return dict(found)
    training, test = drives(job.truck)
    curves = Path(job.work) / f"{job.name}.jsonl"
    watched = job.truck == "trucksim" and job.recipe == "paper"
    observe = _observer(curves) if watched else None
    arguments = replace(RECIPES[job.recipe], seed=job.seed, updates=job.updates)
    truck = train([training], job.folder, arguments, resumes=True, observe=observe)
    found = {"budget": job.updates, **_measured(truck, test, job.truck == "trucksim")}
    if watched:
        found["curves"] = _read(curves, truck)
    files.write(kept, json.dumps(found).encode())
    return found


def runs_of(truck: DeepTruck, test: Recording, long: bool) -> Trials:
    """The paper's: 90 of 40 s, or in the field 10 of 15 s."""
    count, horizon_s = (TRIALS, HORIZON_S) if long else (FIELD_RUNS, FIELD_S)
    return trials(truck, [test], count, horizon_s)


def sample(truck: DeepTruck, test: Recording) -> Trials:
    """One run of 200 s, initialised once."""
    piece = test.piece(SAMPLE.start, SAMPLE.stop)
    modelled = free_run(truck, piece.u[None], piece.w[None], piece.y[:1]).y
    return Trials(piece.u[None], piece.w[None], piece.y[None], modelled, truck.dt, truck.interface.y)


def _measured(truck: DeepTruck, test: Recording, long: bool) -> dict[str, Any]:
    runs = runs_of(truck, test, long)
    found = {**statistics(runs), "updates": truck.details["training"]["updates"], "band": _bands(runs)}
    found["passes"] = passes(truck, found["updates"])
    if long:
        one = sample(truck, test)
        size = np.abs(one.error[0])
        first = round(10.0 / one.dt)
        found["sample"] = {
            "largest_in_10_s": size[:first].max(axis=0).tolist(),
            "largest_later": size[first:].max(axis=0).tolist(),
            "sd_by_50_s": [float(part.std()) for part in np.split(one.error[0, 1:, SPEED], 4)],
        }
    return found


def _bands(runs: Trials) -> dict[str, dict[str, float]]:
    """What the paper reads off its error figures: extremes over time of the mean and of mean -+ sd, and the
    largest mean magnitude at any time; also without the first TRANSIENT_S."""
    mean, sd = against_time(runs)
    size = np.nanmean(np.abs(runs.error), axis=0)
    settled = round(TRANSIENT_S / runs.dt)
    found = {}
    for j, name in enumerate(runs.channels):
        found[name] = {
            "least": float((mean - sd)[1:, j].min()),
            "most": float((mean + sd)[1:, j].max()),
            "settled_least": float((mean - sd)[settled:, j].min()),
            "settled_most": float((mean + sd)[settled:, j].max()),
            "mean_least": float(mean[settled:, j].min()),
            "mean_most": float(mean[settled:, j].max()),
            "mean": float(mean[settled:, j].mean()),
            "largest_mean_abs": float(size[1:, j].max()),
            "largest_mean_abs_settled": float(size[settled:, j].max()),
        }
    return found


def _observer(curves: Path) -> Any:
    """Appends losses on drives that no training sees, line by line, so that a killed run keeps them."""
    unseen = Unseen(drive_of("trucksim", 60, TEST_SEED), drive_of("trucksim", 60, OTHER_SEED))
    curves.parent.mkdir(parents=True, exist_ok=True)
    rounds = iter(range(10**9))

    def observe(done: int, network: TruckNetwork) -> None:
        line: dict[str, Any] = {"updates": done, **{f: v[0] for f, v in unseen.losses(network).items()}}
        if next(rounds) % BY_FEEDBACK == 0:
            line["by_feedback"] = unseen.by_feedback(network)
        with curves.open("a") as file:
            file.write(json.dumps(line) + "\n")

    return observe


def _read(curves: Path, truck: DeepTruck) -> list[dict[str, Any]]:
    """A line for each number of updates; of a killed run the last word counts."""
    lines = {line["updates"]: line for line in map(json.loads, curves.read_text().splitlines())}
    return [{"passes": passes(truck, done), **lines[done]} for done in sorted(lines)]
