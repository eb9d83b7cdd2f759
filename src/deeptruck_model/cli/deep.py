"""`deeptruck-model train` and `export`."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from deeptruck_core import files
from deeptruck_core.errors import InputError
from deeptruck_core.terminal import console
from deeptruck_model import results
from deeptruck_model.cli.inputs import (
    Bags,
    ClockOption,
    MessageFiles,
    Overwrite,
    TopicMap,
    deep_truck,
    read,
)
from deeptruck_model.cli.judging import calibrate, evaluate

if TYPE_CHECKING:
    from deeptruck_model.deep import Arguments
    from deeptruck_model.recordings import Recording

FEW_MINUTES = 10.0


class Mode(StrEnum):
    """Training recipes."""

    default = "default"
    paper = "paper"


class Kind(StrEnum):
    """The kind of decoder."""

    black = "black"
    grey = "grey"


def train(
    bags: Bags,
    out: Annotated[Path, typer.Option(help="Simulator directory to write.", metavar="SIM")],
    seed: Annotated[int, typer.Option(help="Seed of weights and data order.", min=0)] = 0,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on where a killed run of the same command stopped.")
    ] = False,
    overwrite: Overwrite = False,
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
    topic_map: TopicMap = None,
    clock: ClockOption = None,
    msg: MessageFiles = None,
) -> None:
    """Train a deep truck on recordings of one truck.

    Example: deeptruck-model train drives/monday drives/tuesday --out simulators/mytruck
    """
    results.apart(out, *bags, *([start] if start else []))
    results.DEEP_TRUCK.check(out, resume=resume, overwrite=overwrite or resume)
    recordings = read(bags, topic_map, clock, msg)
    from deeptruck_model.deep import Arguments

    arguments = Arguments(
        seed=seed,
        mode=mode.value,
        kind=kind.value,
        updates=budget,
        members=members,
        start="" if start is None else str(start),
    )
    _train(recordings, out, arguments, resumes=resume, overwrite=overwrite)


def _train(
    recordings: list[Recording], out: Path, arguments: Arguments, *, resumes: bool, overwrite: bool
) -> None:
    """Train, and print a summary."""
    from deeptruck_model.deep import finished
    from deeptruck_model.deep import train as train_truck

    if resumes and finished(recordings, out, arguments):
        typer.echo(f"{out}: finished before, with these recordings and arguments; nothing was left to do")
        return
    minutes = sum(len(recording) * recording.dt for recording in recordings) / 60
    if minutes < FEW_MINUTES:
        typer.echo(f"note: {minutes:.1f} min of driving are little; the tutorial trains on an hour", err=True)
    training = train_truck(recordings, out, arguments, resumes=resumes, overwrite=overwrite).details[
        "training"
    ]
    for line in training["unexcited"]:
        typer.echo(f"note: {line}", err=True)
    typer.echo(f"{out}: trained in {training['seconds']:.0f} s; see {out / 'MODEL_CARD.md'}")


def export(
    simulator: Annotated[
        str,
        typer.Argument(
            metavar="SIM", help="Directory of a deep truck; for --fmu also truck:NAME, or either corrected."
        ),
    ],
    out: Annotated[
        Path | None, typer.Option("--out", "--onnx", help="ONNX file to write.", metavar="FILE")
    ] = None,
    fmu: Annotated[
        Path | None, typer.Option(help="FMU (FMI 3, co-simulation) to write; extra 'fmu'.", metavar="FILE")
    ] = None,
) -> None:
    """One step of a deep truck as ONNX, without Python; or any truck of ours as an FMU, with Python.

    Example: deeptruck-model export simulators/mytruck --out mytruck.onnx
    """
    if (out is None) == (fmu is None):
        raise InputError("give either --out FILE.onnx or --fmu FILE.fmu")
    if fmu is not None:
        _export_fmu(simulator, fmu)
        return
    assert out is not None
    files.check_new(out)
    results.apart(out, Path(simulator))
    from deeptruck_model.deep import onnx_export

    truck = deep_truck(simulator)
    onnx_export.export(truck, out)
    typer.echo(f"{out}: inputs h, c, y, u, w of one step of {truck.dt:g} s; see docs/deep_model.md")


def _export_fmu(simulator: str, out: Path) -> None:
    from deeptruck_model.fmu import export as fmu_export

    files.check_new(out)
    results.apart(out, Path(simulator))
    fmu_export.export(simulator, out)
    typer.echo(f"{out}: FMI 3 for co-simulation; it needs Python with deeptruck, see docs/simulators.md")


def register(app: typer.Typer) -> None:
    """Add this room's commands to the console script."""
    app.command()(train)
    app.command()(evaluate)
    app.command()(calibrate)
    app.command()(export)
    console.moved(app, "sweep", "'deeptruck-model fleet train TRUCK --seeds N'")
    console.moved(app, "experiment", "python benchmarks/paper/run.py in commit 246717f2 of the repository")
