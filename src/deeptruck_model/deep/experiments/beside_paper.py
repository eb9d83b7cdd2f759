"""What the paper says of its models, measured on the reference trucks in three recipes, seed by seed."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from deeptruck_model import files
from deeptruck_model.deep.arguments import PAPER_FUEL, Arguments
from deeptruck_model.deep.evaluation import HORIZON_S, TRIALS, Trials, against_time, statistics, trials
from deeptruck_model.deep.experiments.learning_curves import COLOURS, Unseen
from deeptruck_model.deep.experiments.output import sample_trials
from deeptruck_model.deep.experiments.paper_rules import (
    FIELD_RUNS,
    FIELD_S,
    LOOKS_AT_FEEDBACK,
    SHORT_UPDATES,
    TRANSIENT_OF_SAMPLE_S,
    TRANSIENT_S,
)
from deeptruck_model.deep.experiments.setup import (
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

RECIPES: dict[str, Arguments] = {
    "paper": PAPER,
    "default": Arguments(),
    "unaided": Arguments(teach=0.0),
}
SHORT = replace(PAPER, updates=SHORT_UPDATES)
VARIANTS: dict[str, Arguments] = {
    "short": SHORT,
    "slower": replace(SHORT, learning_rate=0.005),
    "clipped": replace(SHORT, clip=1.0),
    "free": replace(SHORT, form="deployment"),
    "cubic": replace(SHORT, fuel=1.0),
}
"""The paper's recipe over fewer passes, as it is and with one setting changed at a time."""


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
    watched = job.truck == "trucksim" and (job.recipe == "paper" or job.recipe in VARIANTS)
    recipe = (RECIPES | VARIANTS)[job.recipe]
    observe = _observer(curves, recipe.fuel or PAPER_FUEL) if watched else None
    arguments = replace(recipe, seed=job.seed, updates=job.updates or recipe.updates)
    truck = train([training], job.folder, arguments, resumes=True, observe=observe)
    found = {"name": job.name, "budget": job.updates}
    found |= _measured(truck, training, test, long=job.truck == "trucksim")
    if watched:
        found |= _converged(_read(curves, truck))
    files.write(kept, json.dumps(found).encode())
    return found


def runs_of(truck: DeepTruck, test: Recording, *, long: bool) -> Trials:
    """The paper's: 90 of 40 s, or in the field 10 of 15 s."""
    count, horizon_s = (TRIALS, HORIZON_S) if long else (FIELD_RUNS, FIELD_S)
    return trials(truck, [test], count, horizon_s)


def _measured(truck: DeepTruck, training: Recording, test: Recording, *, long: bool) -> dict[str, Any]:
    runs, updates = runs_of(truck, test, long=long), truck.details["training"]["updates"]
    known = training.channels["speed"]
    low, high = float(np.nanmin(known)), float(np.nanmax(known))
    speeds = runs.measured[..., SPEED]
    inside = (speeds >= low).all(axis=1) & (speeds <= high).all(axis=1)
    found = {**statistics(runs), "updates": updates, "passes": passes(truck, updates)}
    found |= {"largest_fuel": float(np.nanmax(training.channels["fuel_rate"]))}
    found |= {"taught": truck.details["taught"], "band": _bands(runs), "inside": int(inside.sum())}
    if inside.any():
        u, w, measured, modelled = (x[inside] for x in (runs.u, runs.w, runs.measured, runs.modelled))
        found["band_inside"] = _bands(Trials(u, w, measured, modelled, runs.dt, runs.channels))
    if long:
        size = np.abs(sample_trials(truck, test).error[0, :, SPEED])
        first = round(TRANSIENT_OF_SAMPLE_S / runs.dt)
        found |= {"start": float(size[:first].max()), "later": float(size[first:].max())}
    return found


def _bands(runs: Trials) -> dict[str, dict[str, Any]]:
    """What the paper reads off its error figures: the ends over time of mean - sd and mean + sd, of the mean
    alone once the transient is over, and the largest mean magnitude at any time."""
    mean, sd = against_time(runs)
    size, settled = np.nanmean(np.abs(runs.error), axis=0), round(TRANSIENT_S / runs.dt)
    found = {}
    for j, name in enumerate(runs.channels):
        low, high, middle = (mean - sd)[:, j], (mean + sd)[:, j], mean[settled:, j]
        found[name] = {
            "range": [float(low[1:].min()), float(high[1:].max())],
            "settled": [float(low[settled:].min()), float(high[settled:].max())],
            "mean_range": [float(middle.min()), float(middle.max())],
            "mean": float(middle.mean()),
            "largest_mean_abs": float(size[1:, j].max()),
        }
    return found


def _observer(curves: Path, fuel: float) -> Any:
    """Appends losses on drives that no training sees, line by line, so that a killed run keeps them."""
    unseen = Unseen(drive_of("trucksim", 60, TEST_SEED), drive_of("trucksim", 60, OTHER_SEED), fuel)
    curves.parent.mkdir(parents=True, exist_ok=True)
    rounds = iter(range(10**9))

    def observe(done: int, network: TruckNetwork) -> None:
        line: dict[str, Any] = {"updates": done, **{f: v[0] for f, v in unseen.losses(network).items()}}
        if next(rounds) % LOOKS_AT_FEEDBACK == 0:
            line["by_feedback"] = unseen.by_feedback(network)
        with curves.open("a") as file:
            file.write(json.dumps(line) + "\n")

    return observe


def _read(curves: Path, truck: DeepTruck) -> list[dict[str, Any]]:
    """A line for each number of updates; of a killed run the last word counts."""
    lines = {line["updates"]: line for line in map(json.loads, curves.read_text().splitlines())}
    return [{"passes": passes(truck, done), **lines[done]} for done in sorted(lines)]


def _converged(curves: list[dict[str, Any]]) -> dict[str, Any]:
    """The curves, where they end, and by which share that differs from the middle of the training."""
    middle, end = curves[(len(curves) - 1) // 2], curves[-1]
    return {
        "curves": curves,
        "end": {form: end[form] for form in COLOURS},
        "change": {form: end[form] / middle[form] - 1.0 for form in COLOURS},
    }
