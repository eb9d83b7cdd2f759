"""`deeptruck-model check-simulator` and `calibrate-truck`."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from deeptruck_core import files
from deeptruck_core.errors import InputError
from deeptruck_core.json_data import to_json
from deeptruck_core.terminal.progress import progress
from deeptruck_model import results
from deeptruck_model.cli.inputs import SIMULATOR, ClockOption, MessageFiles, Overwrite, TopicMap
from deeptruck_model.outside import saved
from deeptruck_model.outside.reference import is_outside, made, refer
from deeptruck_model.outside.truck import lacks

if TYPE_CHECKING:
    from deeptruck_model.mismatch.correction.calibration import Calibration
    from deeptruck_model.recordings import Recording
    from deeptruck_model.simulators.protocol_check import Row


def check_simulator(
    simulator: Annotated[str, typer.Argument(metavar="SIM", help=SIMULATOR)],
    json_file: Annotated[
        Path | None, typer.Option("--json", metavar="FILE", help="Write the table as JSON too, a new file.")
    ] = None,
    accept: Annotated[
        bool,
        typer.Option(
            "--accept", help="Accept files of the simulator that changed since its directory was written."
        ),
    ] = False,
) -> None:
    """Drive a simulator a few seconds: what it fulfils, and what it lacks.

    Example: deeptruck-model check-simulator python:examples.shuttle:make
    """
    if json_file is not None:
        files.check_new(json_file)
        results.apart(json_file, Path(simulator), elsewhere="choose another --json")
    place = _stands_for(simulator) if accept else None
    table = _members(simulator) or _driven(simulator, place)
    _tell(table)
    if json_file is not None:
        with files.new_file(json_file) as draft:
            content = {"simulator": simulator, "rows": to_json(table)}
            draft.write_text(json.dumps(content, indent=1))
    _judge(simulator, table)
    if place is not None:
        saved.accept(place)
        typer.echo(f"accepted: {place} stands for it as it is now")
    notes = sum(bool(row.mend) for row in table)
    but = f", but for {notes} note{'s' * (notes > 1)} above" if notes else ""
    typer.echo(f"{simulator} is fit for use{but}")


def _stands_for(simulator: str) -> Path:
    place = saved.stands_for(Path(simulator))
    if place is None:
        raise InputError(f"{simulator} stands for no outside simulator; leave out --accept")
    return place


def _members(simulator: str) -> list[Row]:
    """A row for each missing member of an outside simulator; empty if it can be driven."""
    if not is_outside(simulator):
        return []
    lacking = lacks(made(refer(simulator)))
    if not lacking:
        return []
    from deeptruck_model.simulators.protocol_check import Mark, Row

    parts = (says.partition("; ") for says in lacking.values())
    return [Row(name, Mark.NO, says, mend) for name, (says, _, mend) in zip(lacking, parts, strict=True)]


def _driven(simulator: str, changed: Path | None) -> list[Row]:
    """The table of a simulator, or of the present simulator to which the folder `changed` refers."""
    from deeptruck_model import simulators
    from deeptruck_model.simulators import protocol_check

    truck = simulators.load(simulator) if changed is None else saved.as_it_is(changed)
    with progress("checking the simulator") as say:
        return protocol_check.examine(truck, say)


def _tell(table: list[Row]) -> None:
    width = max(len(row.about) for row in table)
    for row in table:
        typer.echo(f"{row.state:<4}  {row.about:<{width}}  {row.says}")
        if row.mend:
            typer.echo(f"{'':<4}  {'':<{width}}  -> {row.mend}")


def _judge(simulator: str, table: list[Row]) -> None:
    from deeptruck_model.simulators.protocol_check import missing

    if lacking := missing(table):
        names = ", ".join(row.about for row in lacking)
        raise InputError(f"{simulator} is not fit for use: mend {names}, as the table says")


def calibrate_truck(
    truck: Annotated[
        str,
        typer.Argument(metavar="TRUCK", help="truck:NAME[:overrides.yaml], truck:FILE.yaml, or its folder."),
    ],
    recordings: Annotated[list[Path], typer.Option(help="Bags to fit; list several.")],
    out: Annotated[Path, typer.Option(help="Folder for the fitted truck.")],
    held_out: Annotated[list[Path] | None, typer.Option(help="Bags used only to judge.")] = None,
    keep: Annotated[
        bool,
        typer.Option("--keep", help="Write the fitted truck even if it drives held-out recordings worse."),
    ] = False,
    topic_map: TopicMap = None,
    clock: ClockOption = None,
    msg: MessageFiles = None,
    overwrite: Overwrite = False,
) -> None:
    """Fit a physics truck's parameters to recordings, and say which of them these do not identify.

    Example: deeptruck-model calibrate-truck truck:trucksim --recordings a b --held-out c --out mine
    """
    held_out = held_out or []
    results.PHYSICS_TRUCK.check(out, overwrite=overwrite)
    results.apart(out, Path(truck), *recordings, *held_out)
    from deeptruck_model import recordings as rec
    from deeptruck_model import simulators
    from deeptruck_model.recordings.several import check_paths_apart
    from deeptruck_model.trucks import PhysicsTruck

    check_paths_apart(recordings, held_out)
    given = simulators.load(truck)
    if not isinstance(given, PhysicsTruck):
        raise InputError(f"{truck} is no physics truck; 'deeptruck-model mismatch' refits other simulators")
    with progress("reading") as say:
        from deeptruck_model.mismatch.correction.calibration import calibrate
        from deeptruck_model.trucks import gears

        fit, held = (
            rec.read_all(
                bags, topic_map=topic_map, rate_hz=1.0 / given.dt, among=others, clock=clock, msg=msg or ()
            )
            for bags, others in ((recordings, held_out), (held_out, recordings))
        )
        gears.check(given, [*fit, *held])
        found = calibrate(given, fit, held, say=say)
    typer.echo("\n".join([*_calibrated(found), *_stated_mass(found, fit)]))
    if not keep:
        _check_no_worse(found)
    found.truck.save(out, overwrite=overwrite)
    typer.echo(f"truck in {out}")


def _check_no_worse(found: Calibration) -> None:
    """Raises InputError if the fitted truck has a larger speed error on held-out recordings."""
    if found.before is None or found.after is None or found.after.speed <= found.before.speed:
        return
    raise InputError(
        f"the fit makes the speed error on {', '.join(found.held_out)} larger, {found.before.speed:.3g} to "
        f"{found.after.speed:.3g} m/s, so that nothing was written: --keep writes it, 'deeptruck-model "
        "mismatch' looks for what these parameters do not have"
    )


def _stated_mass(found: Calibration, recordings: Sequence[Recording]) -> Iterator[str]:
    """Remarks if the mass stated by recordings is outside the interval from their drives."""
    from deeptruck_model.mismatch.correction.from_draws import contradicted_mass

    for p in found.parameters:
        if p.name == "mass" and p.ci95 is not None:
            yield from (f"note: {line}" for line in contradicted_mass(recordings, p.value, p.ci95))


def _calibrated(found: Calibration) -> Iterator[str]:
    """Lines on the parameters, the resulting coast-down coefficients, and the improvement."""
    from deeptruck_model.trucks.coast_down import UNITS, CoastDown

    for p in found.parameters:
        value = "as given: these drives do not determine it"
        if p.name == "mass" and found.mass_held:
            value = "as given: these drives do not separate it from the gains"
        if p.ci95 is not None:
            value = f"{p.value:.4g}  (95 %: {p.ci95[0]:.4g} to {p.ci95[1]:.4g})"
        unit = "" if p.unit == "1" else f" {p.unit}"
        yield f"{p.name:<20} {p.given:.4g}{unit} -> {value}"
    for one, other in found.alike:
        yield f"note: {one} and {other} are identifiable together only; vary what one of them depends on"
    if found.mass_held:
        yield "note: all other values and intervals are for this mass; weigh the truck if it is uncertain"
    load = CoastDown.of(found.truck.parameters())
    for unit in UNITS:
        a, b, c = load.printed(unit)
        yield f"{'coast-down':<20} A {a:.4g}, B {b:.4g}, C {c:.4g} ({unit})"
    if found.before is None or found.after is None or found.better is None:
        yield "note: the held-out recordings are too short for free runs that show whether this is better"
    else:
        yield (
            f"speed error of free runs of {found.horizon_s:.0f} s on {', '.join(found.held_out)}: "
            f"{found.before.speed:.3g} -> {found.after.speed:.3g} m/s ({_change(*found.better)}, 95 %)"
        )
        if not found.validated:
            yield "note: it drives held-out recordings no better; 'deeptruck-model mismatch' looks further"
    yield from (f"note: {caveat}" for caveat in found.caveats)


def _change(low: float, high: float) -> str:
    """The interval of an error's relative improvement, in words."""
    low, high = 100.0 * low, 100.0 * high
    if low >= 0.0:
        return f"smaller by {low:.0f} to {high:.0f} %"
    if high >= 0.0:
        return f"between {-low:.0f} % larger and {high:.0f} % smaller"
    return f"larger by {-high:.0f} to {-low:.0f} %"


def register(app: typer.Typer) -> None:
    """Add these commands to the console script."""
    app.command("check-simulator")(check_simulator)
    app.command("calibrate-truck")(calibrate_truck)
