"""The paper's modelling experiments on the reference trucks: each writes figures and a table into one folder.

Training, validation and test drives come from the driving-cycle generator with seeds of their own;
settings were chosen on validation drives (seed 2), the test drives below are only ever read.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from deeptruck_model import trucks
from deeptruck_model.deep import report
from deeptruck_model.deep.evaluation import statistics, trials
from deeptruck_model.deep.experiments import classics
from deeptruck_model.deep.experiments.fitted_physics import physics
from deeptruck_model.deep.experiments.look_alikes import LookAlikes
from deeptruck_model.deep.experiments.minutes import minutes_of_data
from deeptruck_model.deep.experiments.output import (
    SHORT_RUNS,
    Row,
    budget,
    intervals,
    of_seeds,
    sample_run,
    table,
    write,
)
from deeptruck_model.deep.experiments.paper_rules import FIELD_RUNS, FIELD_S
from deeptruck_model.deep.experiments.setup import (
    FIELD,
    LOOK_ALIKE_SEED,
    TEST_SEED,
    TRAIN_SEED,
    VALIDATION_SEED,
    chosen,
    drive_of,
    field_drives,
    trained,
)
from deeptruck_model.deep.truck import DeepTruck
from deeptruck_model.deep.uncertainty import calibrated, inside
from deeptruck_model.driving_cycles import drive
from deeptruck_model.recordings import Recording
from deeptruck_model.simulators import Simulator

LOOK_ALIKE_H = 12
INTERVAL_RUNS = 300


def error_statistics(out: Path, seeds: int = 1, updates: int = 0, mode: str = "default") -> dict[str, Any]:
    """Paper: 4 h of the simulation truck, 90 trials of 40 s on another 3 h; scenarios; a sample run of 200
    s."""
    test = drive_of("trucksim", 180, TEST_SEED)
    truck = trained([drive_of("trucksim", 240, TRAIN_SEED)], chosen(seeds, updates, mode))
    members = [statistics(trials(single, [test])) for single in singles(truck)]
    metrics: dict[str, Any] = {
        "ensemble": report.evaluate_into(out, truck, [test]),
        "seeds": members,
        "same_physics_unknown_state": statistics(trials(trucks.load("trucksim"), [test])),
        "same_physics_look_alikes": statistics(trials(_look_alikes(), [test])),
        "intervals": _intervals(truck, test),
    }
    sample_run(truck, test, out / "sample_run.png")
    alike = f"the physics itself, from {LOOK_ALIKE_H} h of states that looked like the start"
    rows = [
        *of_seeds(members),
        ("mean of all seeds", metrics["ensemble"]),
        ("the physics itself, settled at the start", metrics["same_physics_unknown_state"]),
        (alike, metrics["same_physics_look_alikes"]),
    ]
    title = f"Open-loop errors on `trucksim`, mode {mode}: 4 h training, 3 h test, 90 x 40 s"
    table(out, title, rows, f"{budget(truck)}\n\n{intervals(metrics['intervals'])}")
    return write(out, metrics)


def _intervals(truck: DeepTruck, test: Recording) -> dict[str, dict[str, float]]:
    """Share of the test points in the 90 % intervals of the mean, by what set them."""
    runs = trials(truck, [test], INTERVAL_RUNS)
    again = calibrated(truck, [drive_of("trucksim", 180, VALIDATION_SEED)])
    return {
        "as training leaves them": inside(truck, runs),
        "as `calibrate` sets them by 3 h of other driving": inside(again, runs),
    }


def field(out: Path, seeds: int = 5, updates: int = 0, mode: str = "default") -> dict[str, Any]:
    """The two field configurations with the paper's budgets: 85/15 by time, ten simulations of 15 s."""
    metrics: dict[str, Any] = {}
    rows: list[Row] = []
    for name in FIELD:
        training, held_out = field_drives(name)
        truck = trained([training], chosen(seeds, updates, mode))
        (out / name).mkdir()
        metrics[name] = report.evaluate_into(out / name, truck, [held_out], FIELD_RUNS, FIELD_S)
        members = [statistics(trials(single, [held_out], FIELD_RUNS, FIELD_S)) for single in singles(truck)]
        metrics[name]["seeds"] = members
        what = f"{name}, {FIELD[name].minutes} min: "
        rows += [(f"{what}mean of all seeds", metrics[name]), *of_seeds(members, what, SHORT_RUNS)]
    title = f"Field configurations on the reference trucks, mode {mode}: ten runs of 15 s"
    table(out, title, rows, budget(truck), SHORT_RUNS)
    return write(out, metrics)


def beside_classics(out: Path, seeds: int = 1, updates: int = 0) -> dict[str, Any]:
    """Deep truck, ARX, NARX, gradient boosting and a fitted physics truck on the same splits of `trucksim`,
    60 min of training."""
    drives, test = [drive_of("trucksim", 60, TRAIN_SEED)], drive_of("trucksim", 180, TEST_SEED)
    truck = trained(drives, chosen(seeds, updates))
    compared: dict[str, Simulator] = {"deep truck": truck}
    compared |= {
        name: fit(drives) for name, fit in {**classics.MODELS, "fitted physics truck": physics}.items()
    }
    metrics = {name: statistics(trials(model, [test])) for name, model in compared.items()}
    title = "Deep truck beside the classics: 1 h training, 3 h test, 90 x 40 s"
    table(out, title, list(metrics.items()), budget(truck))
    return write(out, metrics)


EXPERIMENTS: dict[str, Callable[..., dict[str, Any]]] = {
    "error-statistics": error_statistics,
    "field": field,
    "classics": beside_classics,
    "minutes": minutes_of_data,
}


def _look_alikes() -> LookAlikes:
    truck = trucks.load("trucksim")
    return LookAlikes(truck, drive(truck, hours=LOOK_ALIKE_H, seed=LOOK_ALIKE_SEED))


def singles(truck: DeepTruck) -> list[DeepTruck]:
    """The members of an ensemble, each as a truck of its own."""
    return [DeepTruck(truck.network.member(m), truck.interface) for m in range(truck.network.shape.members)]
