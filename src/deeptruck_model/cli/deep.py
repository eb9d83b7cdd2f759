"""`deeptruck-model train`, `sweep`, `evaluate`, `calibrate`, `export` and `experiment`."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from deeptruck_model.errors import InputError

if TYPE_CHECKING:
    from deeptruck_model.deep import DeepTruck
    from deeptruck_model.recordings import Recording

Bags = Annotated[list[Path], typer.Argument(metavar="BAG...", help="Bags (folders) of one truck.")]


FEW_MINUTES = 10.0


class Mode(StrEnum):
    """Training recipes."""

    default = "default"
    paper = "paper"


class Kind(StrEnum):
    """What the decoder gives."""

    black = "black"
    grey = "grey"


def train(
    bags: Bags,
    out: Annotated[Path, typer.Option(help="Simulator directory to write.", metavar="SIM")],
    seed: Annotated[int, typer.Option(help="Seed of weights and data order.", min=0)] = 0,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on where a killed run of the same command stopped.")
    ] = False,
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Replace a simulator that is there.")
    ] = False,
    mode: Annotated[
        Mode, typer.Option(help="paper: training form and Adagrad, as published.")
    ] = Mode.default,
    kind: Annotated[
        Kind, typer.Option(help="grey: the decoder also gives gains by which the commands act.")
    ] = Kind.black,
    budget: Annotated[
        int,
        typer.Option(
            help="Gradient updates; 0 chooses them from the amount of data (up to 2 min of one core).", min=0
        ),
    ] = 0,
    start: Annotated[
        Path | None, typer.Option("--from", help="Deep truck of the same signals to adapt.", metavar="SIM")
    ] = None,
    members: Annotated[
        int, typer.Option(help="Models in the ensemble; 3 or more give intervals.", min=1, max=100)
    ] = 1,
) -> None:
    """Train a deep truck on recordings of one truck.

    Example: deeptruck-model train drives/monday drives/tuesday --out simulators/mytruck
    """
    from deeptruck_model.deep import Arguments, finished
    from deeptruck_model.deep import train as train_truck
    from deeptruck_model.simulators import MANIFEST

    if (out / MANIFEST).exists() and not (resume or overwrite):
        raise InputError(f"{out} exists already; choose another --out, or add --overwrite")
    arguments = Arguments(
        seed=seed,
        mode=mode.value,
        kind=kind.value,
        updates=budget,
        members=members,
        start="" if start is None else str(start),
    )
    recordings = _read(bags)
    if resume and finished(recordings, out, arguments):
        typer.echo(f"{out}: finished before, with these recordings and arguments; nothing was left to do")
        return
    minutes = sum(len(recording) * recording.dt for recording in recordings) / 60
    if minutes < FEW_MINUTES:
        typer.echo(f"note: {minutes:.1f} min of driving are little; the tutorial trains on an hour", err=True)
    truck = train_truck(recordings, out, arguments, resumes=resume)
    typer.echo(f"{out}: trained in {truck.details['training']['seconds']:.0f} s; see {out / 'MODEL_CARD.md'}")


class Engine(StrEnum):
    """Where a sweep trains."""

    processes = "processes"
    ray = "ray"


def sweep(
    bags: Bags,
    out: Annotated[Path, typer.Option(help="Folder for the trucks, sweep.md and sweep.json.", metavar="DIR")],
    set_: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            help="Values of a setting, such as budget or learning_rate; repeat for a grid.",
            metavar="NAME=A,B",
        ),
    ] = None,
    seeds: Annotated[int, typer.Option(help="Seeds of each combination.", min=1)] = 1,
    workers: Annotated[int, typer.Option(help="Trucks trained side by side.", min=1)] = 1,
    engine: Annotated[
        Engine, typer.Option(help="ray: on the cluster that RAY_ADDRESS names; extra 'ray'.")
    ] = Engine.processes,
) -> None:
    """Train a grid of settings and seeds, and rank them on held-out driving. A killed sweep goes on.

    Example: deeptruck-model sweep drives/monday --out rates --set learning_rate=0.003,0.006 --seeds 5
    """
    from deeptruck_model import sweeps
    from deeptruck_model.deep.sweep import sweep as train_all

    def say(line: str) -> None:
        typer.echo(line, err=True)

    grid = sweeps.read_grid(set_ or [])
    train_all(bags, out, grid, seeds=seeds, workers=workers, engine=engine.value, tell=say)
    typer.echo((out / "sweep.md").read_text())


def evaluate(
    simulator: Annotated[str, typer.Argument(metavar="SIM", help="Simulator directory, or truck:NAME.")],
    bags: Bags,
    out: Annotated[Path, typer.Option(help="Folder for metrics.json and the figures.", metavar="DIR")],
    trials: Annotated[int, typer.Option(help="Free runs.", min=1)] = 90,
    horizon: Annotated[float, typer.Option(help="Length of a free run in s.", min=1.0)] = 40.0,
    seed: Annotated[int, typer.Option(help="Seed of the starts.", min=0)] = 0,
) -> None:
    """Open-loop error statistics of a simulator on recordings: metrics.json and figures.

    Example: deeptruck-model evaluate simulators/mytruck drives/friday --out evaluation
    """
    from deeptruck_model import simulators
    from deeptruck_model.deep import evaluate as evaluate_simulator

    if (out / "metrics.json").exists():
        typer.echo(f"note: the evaluation that was in {out} is replaced", err=True)
    metrics = evaluate_simulator(simulators.load(simulator), _read(bags), out, trials, horizon, seed)
    typer.echo(f"{metrics['trials']} free runs of {metrics['horizon_s']:.0f} s")
    for name, values in metrics.items():
        if isinstance(values, dict):
            held = (
                f", {100 * values['inside_90']:.0f} % in the 90 % interval" if "inside_90" in values else ""
            )
            typer.echo(
                f"{name:>13}: mean abs error {values['mean_abs']:.4f}, rmse {values['rmse']:.4f}{held}"
            )
    typer.echo(f"figures and metrics.json in {out}")


def calibrate(
    simulator: Annotated[str, typer.Argument(metavar="SIM", help="Simulator directory of a deep truck.")],
    bags: Bags,
    out: Annotated[Path, typer.Option(help="Simulator directory to write.", metavar="SIM")],
) -> None:
    """Set the 90 % intervals by drives that the truck was not trained on; an hour or more is worth it.

    Example: deeptruck-model calibrate simulators/mytruck drives/friday --out simulators/calibrated
    """
    from deeptruck_model.deep import uncertainty
    from deeptruck_model.simulators import MANIFEST

    if (out / MANIFEST).exists():
        raise InputError(f"{out} exists already; choose another --out")
    uncertainty.calibrated(_deep(simulator), _read(bags)).save(out)
    typer.echo(f"{out}: intervals set; 'deeptruck-model evaluate' on a third drive says what they hold")


def export(
    simulator: Annotated[str, typer.Argument(metavar="SIM", help="Simulator directory of a deep truck.")],
    out: Annotated[Path, typer.Option(help="ONNX file to write.", metavar="FILE")],
) -> None:
    """One step of a deep truck as ONNX, for controllers and test rigs without Python.

    Example: deeptruck-model export simulators/mytruck --out mytruck.onnx
    """
    from deeptruck_model.deep import onnx_export

    truck = _deep(simulator)
    onnx_export.export(truck, out)
    typer.echo(f"{out}: inputs h, c, y, u, w of one step of {truck.dt:g} s; see docs/deep_model.md")


class Experiment(StrEnum):
    """The experiments of `deeptruck_model.deep.experiments`."""

    error_statistics = "error-statistics"
    learning_curves = "learning-curves"
    field = "field"
    classics = "classics"
    minutes = "minutes"


def experiment(
    name: Annotated[Experiment, typer.Argument(help="Which of the paper's experiments, or one past it.")],
    out: Annotated[
        Path, typer.Option(help="Folder; a subfolder of the experiment's name is written.")
    ] = Path("docs/results"),
    seeds: Annotated[
        int, typer.Option(help="Models trained; 0 takes the experiment's own number.", min=0)
    ] = 0,
    budget: Annotated[int, typer.Option(help="Gradient updates of each; 0 chooses.", min=0)] = 0,
) -> None:
    """Repeat an experiment of the paper on the reference trucks: figures, table and metrics.json.

    Example: deeptruck-model experiment error-statistics --seeds 30
    """
    from deeptruck_model.deep.experiments import EXPERIMENTS

    given = {"seeds": seeds} if seeds else {}
    EXPERIMENTS[name.value](out / name.value, updates=budget, **given)
    typer.echo(f"written: {out / name.value}")


def _deep(simulator: str) -> DeepTruck:
    from deeptruck_model import simulators
    from deeptruck_model.deep import DeepTruck

    truck = simulators.load(simulator)
    if not isinstance(truck, DeepTruck):
        raise InputError(f"{simulator} is no deep truck; train one with 'deeptruck-model train'")
    return truck


def _read(bags: list[Path]) -> list[Recording]:
    from deeptruck_model import recordings

    return [recording for bag in bags for recording in recordings.read(bag)]


def register(app: typer.Typer) -> None:
    """Add this room's commands to the console script."""
    app.command()(train)
    app.command()(sweep)
    app.command()(evaluate)
    app.command()(calibrate)
    app.command()(export)
    app.command()(experiment)
