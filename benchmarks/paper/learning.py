"""The paper's statements on its models, measured on the reference trucks in three recipes, with seeds in
batches, and linear probes of the trained state.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from sklearn.linear_model import RidgeClassifierCV, RidgeCV
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from benchmarks.paper.drives import (
    OTHER_SEED,
    PAPER,
    TEST_SEED,
    TRAIN_SEED,
    drive_of,
    field_drives,
    passes,
    singles,
)
from benchmarks.paper.output import COLOURS, Unseen, sample_trials
from benchmarks.paper.page import (
    BATCH,
    DIGITS,
    DRAWN_DIGITS,
    ERRORS_S,
    FIELD_RUNS,
    FIELD_S,
    LOOKS_AT_FEEDBACK,
    PROBE_AFTER_S,
    PROBE_PAST_S,
    PROBE_S,
    SHORT_UPDATES,
    TRANSIENT_OF_SAMPLE_S,
    TRANSIENT_S,
)
from deeptruck_model import files, simulators, trucks
from deeptruck_model.deep.arguments import PAPER_FUEL, Arguments
from deeptruck_model.deep.data import Scales
from deeptruck_model.deep.evaluation import HORIZON_S, TRIALS, Trials, against_time, statistics, trials
from deeptruck_model.deep.network import TruckNetwork
from deeptruck_model.deep.training import train
from deeptruck_model.deep.truck import DeepTruck
from deeptruck_model.recordings import Recording
from deeptruck_model.signals import SPEED
from deeptruck_model.simulators import Simulator

RECIPES: dict[str, Arguments] = {
    "paper": PAPER,
    "default": Arguments(),
    "unaided": Arguments(auxiliary=0.0),
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
OWN = "physics"
"""In place of a recipe: the physics truck itself."""
Array = NDArray[np.float64]
TARGETS = {"gear": "gear", "front_pressure": "brake pressure", "drag_force": "drag"}
SOURCES = {
    "state": "state",
    "untrained": "state of an untrained network",
    "past": "inputs of the last 4 s",
    "now": "inputs",
}
EVERY = 5  # samples from one that is read to the next
PENALTIES = np.logspace(-3, 5, 9)  # of the ridge; chosen by leave-one-out on the drive it is fitted to
DRAWS, TAILS = 500, (5.0, 95.0)  # of the bootstrap over runs; percent


class Job(NamedTuple):
    """Trucks that are trained in one batch: `seeds` of them from seed `first` on, of one reference truck, by
    one recipe. 0 updates: as many as the recipe has."""

    work: str
    truck: str
    recipe: str
    first: int
    seeds: int = 1
    updates: int = 0

    @property
    def name(self) -> str:
        last = f"-{self.first + self.seeds - 1}" if self.seeds > 1 else ""
        return f"{self.truck}-{self.recipe}-{self.first}{last}"

    @property
    def names(self) -> list[str]:
        """Names of the seeds, under which their figures are kept."""
        return [f"{self.truck}-{self.recipe}-{self.first + m}" for m in range(self.seeds)]

    @property
    def folder(self) -> Path:
        """The folder of the deep truck, whose members are the seeds."""
        return Path(self.work) / "trucks" / self.name


def to_learn(work: str, truck: str, recipe: str, seeds: int, updates: int = 0) -> list[Job]:
    """Batches of consecutive seeds below `seeds` that are not measured yet."""
    jobs: list[Job] = []
    for seed in range(seeds):
        alone = Job(work, truck, recipe, seed, 1, updates)
        if _known(Path(work) / f"{alone.name}.json", updates):
            continue
        if jobs and jobs[-1].first + jobs[-1].seeds == seed and jobs[-1].seeds < BATCH:
            jobs[-1] = jobs[-1]._replace(seeds=jobs[-1].seeds + 1)
        else:
            jobs.append(alone)
    return jobs


def _known(kept: Path, updates: int) -> bool:
    """Whether a seed's figures exist, with this budget and of the present version."""
    if not kept.exists():
        return False
    found = json.loads(kept.read_text())
    return bool(found["budget"] == updates and "errors" in found)


def first_truck(work: Path, truck: str, recipe: str) -> tuple[Path, DeepTruck] | None:
    """The truck of seed 0 and its folder; None if it was not trained yet."""
    for folder in sorted((work / "trucks").glob(f"{truck}-{recipe}-0*")):
        if (folder / simulators.MANIFEST).exists():  # an empty folder only reserves the name
            found = simulators.load(folder)
            assert isinstance(found, DeepTruck)
            return folder, singles(found)[0]
    return None


@cache
def drives(truck: str, *, as_driven: bool = False) -> tuple[Recording, Recording]:
    """Training and test drive: 4 h and 3 h of `trucksim`, or the paper's hours of a field truck, with the
    brake command as in the paper, or `as_driven`."""
    if truck == "trucksim":
        return drive_of(truck, 240, TRAIN_SEED), drive_of(truck, 180, TEST_SEED)
    return field_drives(truck, as_driven=as_driven)


def learn(job: Job) -> list[dict[str, Any]]:
    """Train the seeds of a job in one batch, measure each alone, and keep its figures. A killed training is
    continued."""
    training, test = drives(job.truck)
    curves = Path(job.work) / f"{job.name}.jsonl"
    watched = job.truck == "trucksim" and (job.recipe == "paper" or job.recipe in VARIANTS)
    recipe = (RECIPES | VARIANTS)[job.recipe]
    observe = _observer(curves, recipe.fuel or PAPER_FUEL) if watched else None
    updates = job.updates or recipe.updates
    arguments = replace(recipe, seed=job.first, members=job.seeds, updates=updates)
    trained = train([training], job.folder, arguments, resumes=True, observe=observe)
    found = []
    for member, (name, truck) in enumerate(zip(job.names, singles(trained), strict=True)):
        one = {"name": name, "budget": job.updates, **_trained(truck)}
        one |= _measured(truck, training, test, long=job.truck == "trucksim")
        if watched:
            one |= _converged(_read(curves, truck, member))
        found.append(one)
    for one in found:  # all or none, so that a killed batch is the same batch when it goes on
        files.write(Path(job.work) / f"{one['name']}.json", json.dumps(rounded(one)).encode())
    return found


def rounded(found: Any, digits: int = DIGITS) -> Any:
    """Nested figures with so many significant digits."""
    if isinstance(found, float):
        return float(f"{found:.{digits}g}")
    if isinstance(found, Mapping):
        return {key: rounded(value, digits) for key, value in found.items()}
    return [rounded(value, digits) for value in found] if isinstance(found, list | tuple) else found


def own_equations(work: Path, truck: str) -> None:
    """Measure the physics truck itself, unless its figures exist. Like a deep truck it starts from the
    recorded response, without inner states such as the gear."""
    kept = work / f"{truck}-{OWN}-0.json"
    if not kept.exists():
        training, test = drives(truck, as_driven=True)
        gear, speed = training.channels["gear"], training.channels["speed"]
        found = _measured(trucks.load(truck), training, test, long=truck == "trucksim")
        top = gear == gear.max()
        found["either_gear"] = [float(speed[top].min()), float(speed[gear == gear.max() - 1].max())]
        files.write(kept, json.dumps(rounded(found)).encode())


def runs_of(truck: Simulator, test: Recording, *, long: bool) -> Trials:
    """The runs of the paper: 90 of 40 s if `long`, or in the field 10 of 15 s."""
    count, horizon_s = (TRIALS, HORIZON_S) if long else (FIELD_RUNS, FIELD_S)
    return trials(truck, [test], count, horizon_s)


def _trained(truck: DeepTruck) -> dict[str, Any]:
    updates = truck.details["training"]["updates"]
    return {"updates": updates, "passes": passes(truck, updates), "auxiliary": truck.details["auxiliary"]}


def _measured(truck: Simulator, training: Recording, test: Recording, *, long: bool) -> dict[str, Any]:
    runs = runs_of(truck, test, long=long)
    known = training.channels["speed"]
    low, high = float(np.nanmin(known)), float(np.nanmax(known))
    speeds = runs.measured[..., SPEED]
    inside = (speeds >= low).all(axis=1) & (speeds <= high).all(axis=1)
    found = {**statistics(runs), "largest_fuel": float(np.nanmax(training.channels["fuel_rate"]))}
    found |= {"band": _bands(runs), "inside": int(inside.sum()), "errors": _errors(runs)}
    if inside.any():
        u, w, measured, modelled = (x[inside] for x in (runs.u, runs.w, runs.measured, runs.modelled))
        found["band_inside"] = _bands(Trials(u, w, measured, modelled, runs.dt, runs.channels))
    if long:
        size = np.abs(sample_trials(truck, test).error[0, :, SPEED])
        first = round(TRANSIENT_OF_SAMPLE_S / runs.dt)
        found |= {"start": float(size[:first].max()), "later": float(size[first:].max())}
    return found


def _errors(runs: Trials) -> dict[str, Any]:
    """Mean and standard deviation of the error by channel against the time, every ERRORS_S."""
    every = slice(None, None, round(ERRORS_S / runs.dt))
    mean, sd = (x[every] for x in against_time(runs))
    channels = {
        name: {"mean": mean[:, j].tolist(), "sd": sd[:, j].tolist()} for j, name in enumerate(runs.channels)
    }
    return rounded({"time": runs.time[every].tolist(), "channels": channels}, DRAWN_DIGITS)


def _bands(runs: Trials) -> dict[str, dict[str, Any]]:
    """The figures that the paper reads off its error plots: the extremes over time of mean - sd and mean +
    sd, those of the mean alone once the transient has decayed, and the largest mean magnitude at any time."""
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
    """A function that appends losses on unseen drives to a file line by line, so that a killed run keeps
    them."""
    unseen = Unseen(drive_of("trucksim", 60, TEST_SEED), drive_of("trucksim", 60, OTHER_SEED), fuel)
    curves.parent.mkdir(parents=True, exist_ok=True)
    rounds = iter(range(10**9))

    def observe(done: int, network: TruckNetwork) -> None:
        line: dict[str, Any] = {"updates": done, **unseen.losses(network)}
        if next(rounds) % LOOKS_AT_FEEDBACK == 0:
            line["by_feedback"] = unseen.by_feedback(network)
        with curves.open("a") as file:
            file.write(json.dumps(line) + "\n")

    return observe


def _read(curves: Path, truck: DeepTruck, member: int) -> list[dict[str, Any]]:
    """One row for each number of updates, for one member. If a resumed run repeated rows, the last one is
    taken."""
    lines = {line["updates"]: line for line in map(json.loads, curves.read_text().splitlines())}
    found = []
    for done in sorted(lines):
        line = {form: lines[done][form][member] for form in COLOURS}
        if looks := lines[done].get("by_feedback"):
            line["by_feedback"] = {fed: errors[member] for fed, errors in looks.items()}
        found.append({"passes": passes(truck, done), "updates": done, **line})
    return found


def _converged(curves: list[dict[str, Any]]) -> dict[str, Any]:
    """The curves, their last values, and the relative change of these since the middle of the training."""
    middle, end = curves[(len(curves) - 1) // 2], curves[-1]
    return {
        "curves": curves,
        "end": {form: end[form] for form in COLOURS},
        "change": {form: end[form] / middle[form] - 1.0 for form in COLOURS},
    }


def probe(truck: DeepTruck, fit: Recording, test: Recording, name: str = "trucksim") -> dict[str, Any]:
    """Linear probes: which hidden states of the truck can be read from the LSTM's state by a linear map.

    A deep truck runs freely along a drive that it was not trained on. Ridge regression predicts the gear,
    brake pressure and drag of the physics truck from its state; it is compared with the same regression from
    the inputs, and from the state of an untrained network with the same inputs.

    Returns scores by target and source, each with its 90 % interval: accuracy for the gear, R² for the
    others. The physics truck `name` gives the targets.
    """
    sources, truths = zip(*(_samples(truck, drive, name) for drive in (fit, test)), strict=True)
    return {
        target: {
            source: _score(*(s[source] for s in sources), *(t[target] for t in truths)) for source in SOURCES
        }
        for target in TARGETS
    }


def table(found: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """Lines of a table; `found` maps the names of trucks to their scores."""
    lines = [f"| truck | read | {' | '.join(SOURCES.values())} |", "|---" * (len(SOURCES) + 2) + "|"]
    for truck, scores in found.items():
        for target, says in TARGETS.items():
            cells = (_cell(scores[target][source]) for source in SOURCES)
            lines.append(f"| {truck} | {says} | {' | '.join(cells)} |")
    return [*lines, ""]


def learned(found: Mapping[str, Mapping[str, Any]]) -> str:
    """In words, what trained states contain beyond untrained ones: targets whose intervals do not overlap."""
    more = [
        f"{TARGETS[target]} ({truck})"
        for truck, scores in found.items()
        for target in TARGETS
        if scores[target]["state"][1] > scores[target]["untrained"][2]
    ]
    return f"Above the untrained state, with intervals that do not overlap: {', '.join(more) or 'nothing'}."


def _cell(score: Sequence[float]) -> str:
    middle, low, high = score
    return f"{middle:.3f} ({low:.3f} to {high:.3f})"


def _samples(truck: DeepTruck, drive: Recording, name: str) -> tuple[dict[str, Array], dict[str, Array]]:
    """Features (runs, samples, n) by source and targets (runs, samples) of free runs."""
    steps = round(PROBE_S / truck.dt)
    runs = len(drive) // steps
    inside = trucks.load(name).rollout(drive.u[None], drive.w[None], drive.y[None, 0]).inside
    cut = {target: inside[target][0, : runs * steps].reshape(runs, steps) for target in TARGETS}
    u, w, y = (x[: runs * steps].reshape(runs, steps, -1) for x in (drive.u, drive.w, drive.y))
    state, fed = _run(truck, u, w, y[:, :1])
    read = np.arange(round(PROBE_AFTER_S / truck.dt), steps, EVERY)
    seen = np.concatenate([u, w], axis=-1)
    past = [round(lag / truck.dt) for lag in PROBE_PAST_S]
    lagged = [np.concatenate([seen[:, read - 1 - lag], fed[:, read - lag]], axis=-1) for lag in past]
    features = {
        "state": state[:, read],
        "untrained": _run(_untrained(truck), u, w, fed)[0][:, read],
        "past": np.concatenate(lagged, axis=-1),
        "now": lagged[0],
    }
    return features, {target: values[:, read] for target, values in cut.items()}


def _run(truck: DeepTruck, u: Array, w: Array, fed: Array) -> tuple[Array, Array]:
    """The LSTM's h and c side by side (runs, steps, 2 hidden) and its response (runs, steps, n_y) after each
    step; of an ensemble those of its first member. `fed` (runs, n, n_y) replaces the first n responses."""
    state = truck.reset(fed[:, 0])
    states, responses = [np.concatenate([state.h[0], state.c[0]], axis=-1)], [fed[:, 0]]
    for k in range(u.shape[1] - 1):
        state, _ = truck.step(state, u[:, k], w[:, k])
        if k + 1 < fed.shape[1]:
            state = truck.force(state, fed[:, k + 1])
        states.append(np.concatenate([state.h[0], state.c[0]], axis=-1))
        responses.append(state.y[0])
    return np.stack(states, axis=1), np.stack(responses, axis=1)


def _untrained(truck: DeepTruck) -> DeepTruck:
    """A truck with the initial weights of a training."""
    network = truck.network
    scales = Scales(network.mean.numpy(), network.scale.numpy(), network.top_speed)
    return DeepTruck(TruckNetwork(network.shape, scales, network.dt), truck.interface)


def _score(fit: Array, test: Array, fit_truth: Array, test_truth: Array) -> list[float]:
    """R² (accuracy for a class) of ridge regression on the runs of `test`, and the ends of its 90 %
    interval."""
    classes = bool((fit_truth == np.round(fit_truth)).all())
    ridge = RidgeClassifierCV(PENALTIES) if classes else RidgeCV(PENALTIES)
    model = make_pipeline(StandardScaler(), ridge)
    model.fit(fit.reshape(-1, fit.shape[-1]), fit_truth.ravel())
    found = model.predict(test.reshape(-1, test.shape[-1])).reshape(test_truth.shape)
    if classes:
        error, spread = (found != test_truth).mean(axis=1), np.ones(len(test_truth))
    else:
        error = ((found - test_truth) ** 2).mean(axis=1)
        spread = ((test_truth - test_truth.mean()) ** 2).mean(axis=1)
    drawn = np.random.default_rng(0).integers(0, len(error), (DRAWS, len(error)))
    scores = 1.0 - error[drawn].mean(axis=1) / spread[drawn].mean(axis=1)
    return [float(1.0 - error.mean() / spread.mean()), *map(float, np.percentile(scores, TAILS))]
