"""`deeptruck-model evaluate` and `calibrate`: a simulator compared with recordings."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from deeptruck_core.errors import InputError
from deeptruck_core.signals import printed, sensible, speed_unit
from deeptruck_core.terminal.progress import progress
from deeptruck_model import results
from deeptruck_model.cli.inputs import (
    SIMULATOR,
    Bags,
    ClockOption,
    MessageFiles,
    Overwrite,
    TopicMap,
    Units,
    deep_truck,
    read,
)

if TYPE_CHECKING:
    from deeptruck_model.recordings import Recording
    from deeptruck_model.simulators import Simulator

TOO_NARROW = "intervals that it sets come out too narrow; calibrate with drives it has not seen"


def evaluate(
    simulator: Annotated[str, typer.Argument(metavar="SIM", help=SIMULATOR)],
    bags: Bags,
    out: Annotated[Path, typer.Option(help="Folder for metrics.json, figures, a page.", metavar="DIR")],
    trials: Annotated[int, typer.Option(help="Free runs.", min=1)] = 90,
    horizon: Annotated[float, typer.Option(help="Length of a free run in s.", min=1.0)] = 40.0,
    seed: Annotated[int, typer.Option(help="Seed of the starts.", min=0)] = 0,
    units: Units = "m/s",
    topic_map: TopicMap = None,
    clock: ClockOption = None,
    msg: MessageFiles = None,
    overwrite: Overwrite = False,
) -> None:
    """Open-loop error statistics of a simulator on recordings: metrics.json and figures.

    Example: deeptruck-model evaluate simulators/mytruck drives/friday --out evaluation
    """
    per = speed_unit(units)
    results.apart(out, *bags, Path(simulator))
    results.EVALUATION.check(out, overwrite=overwrite)
    if not math.isfinite(horizon):
        raise InputError(f"a horizon of {horizon:g} s is none; give seconds, such as 40")
    with progress("reading") as say:
        recordings = read(bags, topic_map, clock, msg)
        from deeptruck_model import simulators
        from deeptruck_model.deep import evaluate as evaluate_simulator
        from deeptruck_model.trucks import gears

        truck = simulators.load(simulator)
        said = gears.other_truck(truck, recordings)
        say(f"driving {trials} free runs and the baselines, and drawing them")
        metrics = evaluate_simulator(
            truck, recordings, out, trials, horizon, seed, overwrite=overwrite, named=simulator
        )
    if said:
        typer.echo(f"warning: {said}", err=True)
    typer.echo(f"{metrics['trials']} free runs of {metrics['horizon_s']:.0f} s")
    for name, values in metrics.items():
        if isinstance(values, dict):
            held = (
                f", {100 * values['inside_90']:.0f} % in the 90 % interval" if "inside_90" in values else ""
            )
            unit = truck.interface.unit(name)
            shown, factor = (units, per) if unit == "m/s" else (printed(unit), 1.0)
            typer.echo(
                f"{name:>13}: mean absolute error {sensible(factor * values['mean_abs'])} {shown}, "
                f"rmse {sensible(factor * values['rmse'])} {shown}{held}"
            )
    for baseline in metrics["baselines"]:
        rmse = sensible(per * baseline["speed"]["rmse"])
        typer.echo(f"{baseline['name']}, for comparison: speed rmse {rmse} {units}")
    typer.echo(f"figures and metrics.json in {out}; see {out / 'evaluation.html'}")
    _remarks(truck, recordings, metrics, horizon)


def calibrate(
    simulator: Annotated[str, typer.Argument(metavar="SIM", help="Simulator directory of a deep truck.")],
    bags: Bags,
    out: Annotated[Path, typer.Option(help="Simulator directory to write.", metavar="SIM")],
    topic_map: TopicMap = None,
    clock: ClockOption = None,
    msg: MessageFiles = None,
    overwrite: Overwrite = False,
) -> None:
    """Set the 90 % intervals by drives that the truck was not trained on; an hour or more is advisable.

    Example: deeptruck-model calibrate simulators/mytruck drives/friday --out simulators/calibrated
    """
    results.apart(out, *bags, Path(simulator))
    results.CALIBRATED.check(out, overwrite=overwrite)
    recordings = read(bags, topic_map, clock, msg)
    from deeptruck_model.deep import card, evaluation, remarks
    from deeptruck_model.recordings import splits

    truck = deep_truck(simulator)
    splits.refuse_shared(recordings)
    calibrated = evaluation.calibrated(truck, recordings)
    card.publish_calibrated(calibrated, recordings, Path(simulator), out, overwrite)
    typer.echo(f"{out}: intervals set; 'deeptruck-model evaluate' on a third drive says what they hold")
    if line := remarks.warning(truck, recordings, TOO_NARROW):
        typer.echo(f"warning: {line}", err=True)
    for line in (remarks.few_runs(calibrated, recordings), card.lost_metrics(Path(simulator))):
        if line:
            typer.echo(f"note: {line}", err=True)


def _remarks(
    simulator: Simulator, recordings: list[Recording], metrics: dict[str, Any], horizon: float
) -> None:
    """Print where the errors are less certain than they appear."""
    from deeptruck_model.deep import remarks

    if remarks.is_deep(simulator) and (line := remarks.warning(simulator, recordings)):
        typer.echo(f"warning: {line}", err=True)
    for line in remarks.remarks(simulator, recordings, metrics, horizon):
        typer.echo(f"note: {line}", err=True)
