"""`deeptruck-model check-simulator`: whether a simulator of anybody's is fit for the tools here."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from deeptruck_model import files, results
from deeptruck_model.cli.inputs import SIMULATOR
from deeptruck_model.errors import InputError
from deeptruck_model.outside import saved
from deeptruck_model.outside.reference import is_outside, made, refer
from deeptruck_model.outside.truck import lacks

if TYPE_CHECKING:
    from deeptruck_model.protocol_check import Row


def check_simulator(
    simulator: Annotated[str, typer.Argument(metavar="SIM", help=SIMULATOR)],
    json_file: Annotated[
        Path | None, typer.Option("--json", metavar="FILE", help="Write the table as JSON too, a new file.")
    ] = None,
    accept: Annotated[
        bool, typer.Option("--accept", help="Take changed files of what a directory stands for as they are.")
    ] = False,
) -> None:
    """Drive a simulator a few seconds: what it fulfils, what it lacks, what 'mismatch' will tell of it.

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
            told = {"simulator": simulator, "rows": [row.to_dict() for row in table]}
            draft.write_text(json.dumps(told, indent=1))
    _judge(simulator, table)
    if place is not None:
        saved.accept(place)
        typer.echo(f"accepted: {place} stands for it as it is now")
    typer.echo(f"{simulator} is fit for use")


def _stands_for(simulator: str) -> Path:
    place = saved.stands_for(Path(simulator))
    if place is None:
        raise InputError(f"{simulator} stands for no outside simulator; leave out --accept")
    return place


def _members(simulator: str) -> list[Row]:
    """A row for each part that an outside simulator lacks; none where it can be driven."""
    if not is_outside(simulator):
        return []
    lacking = lacks(made(refer(simulator)))
    if not lacking:
        return []
    from deeptruck_model.protocol_check import Row, State

    parts = (says.partition("; ") for says in lacking.values())
    return [Row(name, State.NO, says, mend) for name, (says, _, mend) in zip(lacking, parts, strict=True)]


def _driven(simulator: str, changed: Path | None) -> list[Row]:
    """The table of a simulator, or of what the folder `changed` stands for, as it is now."""
    from deeptruck_model import checks, protocol_check, simulators

    if changed is None:
        checks.simulator(simulator)
    truck = simulators.load(simulator) if changed is None else saved.as_it_is(changed)
    table = protocol_check.examine(truck)
    if protocol_check.missing(table):
        return table
    from deeptruck_model.mismatch import told

    return [*table, *told.rows(truck)]


def _tell(table: list[Row]) -> None:
    width = max(len(row.about) for row in table)
    for row in table:
        typer.echo(f"{row.state:<4}  {row.about:<{width}}  {row.says}")
        if row.mend:
            typer.echo(f"{'':<4}  {'':<{width}}  -> {row.mend}")


def _judge(simulator: str, table: list[Row]) -> None:
    from deeptruck_model.protocol_check import missing

    if lacking := missing(table):
        names = ", ".join(row.about for row in lacking)
        raise InputError(f"{simulator} is not fit for use: mend {names}, as the table says")


def register(app: typer.Typer) -> None:
    """Add this command to the console script."""
    app.command("check-simulator")(check_simulator)
