"""The paper's modelling experiments on the reference trucks; each writes figures and a table into one folder.

Training, validation and test drives come from the driving-cycle generator with seeds of their own; settings
were chosen on validation drives (seed 2), and the test drives below serve for evaluation only.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from benchmarks.paper import classics
from benchmarks.paper.classics import LookAlikes, physics
from benchmarks.paper.drives import (
    FIELD,
    FLEET_SEED,
    LOOK_ALIKE_SEED,
    TEST_SEED,
    TRAIN_SEED,
    VALIDATION_SEED,
    chosen,
    drive_of,
    field_drives,
    fleet,
    singles,
    trained,
)
from benchmarks.paper.output import (
    SHORT_RUNS,
    Row,
    budget,
    intervals,
    of_seeds,
    sample_run,
    table,
    write,
)
from deeptruck_model import trucks
from deeptruck_model.deep import report
from deeptruck_model.deep.arguments import Arguments
from deeptruck_model.deep.evaluation import calibrated, inside, statistics, trials
from deeptruck_model.deep.training import train
from deeptruck_model.deep.truck import DeepTruck
from deeptruck_model.recordings import Recording
from deeptruck_model.simulators import Simulator
from deeptruck_model.trucks.driving_cycles import drive

TRUCKS = ("trucksim", "freightliner", "volvo")
MINUTES = (5, 15, 60)
FLEET, FLEET_MINUTES = 24, 20  # trucks, of which none is a reference truck
TICKS = (0.2, 0.5, 1, 2)  # m/s
SCRATCH, ADAPTED = "from scratch", "adapted"
Curves = Mapping[str, Mapping[int, Mapping[str, Any]]]
"""statistics by SCRATCH or ADAPTED and minutes; 0 minutes are the fleet alone"""
LOOK_ALIKE_H = 12
INTERVAL_RUNS = 300
FIELD_RUNS, FIELD_S = 10, 15.0  # simulations of a field truck and their length, as in the paper


def minutes_of_data(out: Path, seeds: int = 1, updates: int = 0) -> dict[str, Any]:
    """The three reference trucks: 90 runs of 40 s on 3 h of another drive, after 5, 15 and 60 min of training
    data."""
    arguments = chosen(seeds, updates)
    metrics, note = {}, ""
    for name in TRUCKS:
        whole, test = drive_of(name, max(MINUTES), TRAIN_SEED), drive_of(name, 180, TEST_SEED)
        metrics[name], note = curves(whole, [test], arguments)
    rows = [
        (f"{name}: {minutes} min, {how}" if minutes else f"{name}: the fleet alone", m)
        for name, by_way in metrics.items()
        for how, by_minutes in by_way.items()
        for minutes, m in by_minutes.items()
    ]
    title = f"Minutes of data, alone or after {FLEET} other trucks of {FLEET_MINUTES} min each"
    table(out, f"{title}: 3 h test, 90 x 40 s", rows, note)
    draw(metrics, out / "minutes.png")
    return write(out, metrics)


def curves(whole: Recording, test: Sequence[Recording], arguments: Arguments) -> tuple[dict[str, Any], str]:
    """Error statistics of deep trucks by minutes of `whole`, trained from scratch and adapted from a fleet,
    and a text with the number of updates of each training."""
    found: dict[str, dict[int, Any]] = {SCRATCH: {}, ADAPTED: {}}
    with tempfile.TemporaryDirectory() as folder:
        known = Path(folder) / "fleet"
        truck = train(fleet(whole.interface, FLEET, FLEET_MINUTES, FLEET_SEED), known, arguments)
        found[ADAPTED][0] = statistics(trials(truck, test))
        for minutes in MINUTES:
            drives = [whole.piece(0, round(60 * minutes / whole.dt))]
            scratch, adapted = (
                trained(drives, arguments),
                trained(drives, replace(arguments, start=str(known))),
            )
            found[SCRATCH][minutes] = statistics(trials(scratch, test))
            found[ADAPTED][minutes] = statistics(trials(adapted, test))
    took = {"The fleet": truck, "Adapted": adapted, f"{MINUTES[-1]} min from scratch": scratch}
    return found, " ".join(f"{what}: {budget(of)}" for what, of in took.items())


def draw(metrics: Mapping[str, Curves], path: Path) -> None:
    """Figure of the mean absolute speed error against minutes, one panel for each truck."""
    figure = Figure(figsize=(3.2 * len(metrics), 3.2), layout="constrained")
    panels = figure.subplots(1, len(metrics), sharey=True, squeeze=False)[0]
    for axis, (name, by_way) in zip(panels, metrics.items(), strict=True):
        for how, colour in ((SCRATCH, "tab:blue"), (ADAPTED, "tab:red")):
            errors = {minutes: m["speed"]["mean_abs"] for minutes, m in by_way[how].items()}
            alone = errors.pop(0, None)
            if alone is not None:
                axis.axhline(alone, color="0.5", ls=":", label="the fleet alone")
            axis.plot(list(errors), list(errors.values()), "o-", color=colour, label=how)
        axis.set(xscale="log", yscale="log", xlabel="minutes of its own driving", title=name)
        axis.set_xticks(MINUTES, [str(m) for m in MINUTES], minor=False)
        axis.set_yticks(TICKS, [str(tick) for tick in TICKS])
        axis.minorticks_off()
    panels[0].set_ylabel("mean absolute speed error in 40 s [m/s]")
    panels[-1].legend(fontsize="small")
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=120)


def error_statistics(out: Path, seeds: int = 1, updates: int = 0, mode: str = "default") -> dict[str, Any]:
    """As in the paper: 4 h of the simulated truck, 90 trials of 40 s on another 3 h; scenarios; a sample run
    of 200 s."""
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
    """Coverage of the 90 % intervals of the mean, as training leaves them and as `calibrate` sets them."""
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
