"""`deeptruck-model compare`: compares recordings, simulators and policies."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from deeptruck_core.errors import InputError
from deeptruck_core.signals import speed_unit
from deeptruck_model import checks, results
from deeptruck_model.cli.inputs import ClockOption, MessageFiles, Overwrite, TopicMap, Units

_HELP = """Show drives side by side, aligned in time and along a shared road.

A side is a bag, or SIM@BAG: the simulator, driven by the commands of that bag. The first side is the one
that the others are compared with. What a policy did is a bag too: record it with --record.

Examples:

  deeptruck-model compare drives/monday drives/friday --out days

  deeptruck-model compare drives/friday truck:trucksim@drives/friday --out beside
"""


SET_ONE = "set one with --offset-s, or look for it on the page"


def compare(
    sides: Annotated[list[str], typer.Argument(metavar="SIDE SIDE...", help="Bags, or SIM@BAG.")],
    out: Annotated[Path, typer.Option(help="Folder for compare.html and compare.json.", metavar="DIR")],
    offset_s: Annotated[
        list[str] | None,
        typer.Option(
            help="Shift a side in time by S seconds, instead of by best agreement.", metavar="SIDE=S"
        ),
    ] = None,
    units: Units = "m/s",
    topic_map: TopicMap = None,
    clock: ClockOption = None,
    msg: MessageFiles = None,
    overwrite: Overwrite = False,
) -> None:
    per = speed_unit(units)
    given = _offsets(offset_s or [])
    from deeptruck_model.compare.naming import ONE_RUN, split_name

    results.apart(out, *(split_name(text)[1] for text in sides))
    results.COMPARISON.check(out, overwrite=overwrite)
    for text in sides:
        _a_drive(text, sides)  # else it is said to be no bag
    from deeptruck_model.compare import compare as compared
    from deeptruck_model.compare import write
    from deeptruck_model.compare.alignment import By

    found = compared(sides, given=given, topic_map=topic_map, clock=clock, msg=msg or ())
    with results.COMPARISON.replacing(out, overwrite=overwrite) as draft:
        write(found, draft, units)
    for c in found.compared[1:]:
        off = f"{per * c.difference.speed_rms_m_s:.3g} {units} off" if c.difference else "no time together"
        typer.echo(f"{c.side.name}: moved by {c.offset.seconds:g} s, {off}")
        if c.offset.by is By.NOTHING:
            typer.echo(
                f"note: no offset of {c.side.name} was significant: it begins with the first; {SET_ONE}"
            )
    if any(c.side.simulated for c in found.compared):
        typer.echo(f"note: {ONE_RUN}")
    typer.echo(f"see {out / 'compare.html'}")


compare.__doc__ = _HELP


def _a_drive(text: str, sides: Sequence[str]) -> None:
    """Raises InputError for a simulator without a drive to run along."""
    from deeptruck_model.compare.naming import split_name

    simulator, bag = split_name(text)
    if simulator is None and (
        text.startswith(("truck:", "python:", "fmu:")) or (bag / checks.MANIFEST).exists()
    ):
        drive = next((s for s in sides if s != text and "@" not in s), "BAG")
        raise InputError(f"{text} is a simulator, which runs along a drive: write {text}@{drive}")


def _offsets(texts: Sequence[str]) -> dict[str, float]:
    out = {}
    for text in texts:
        name, _, seconds = text.rpartition("=")
        try:
            out[name] = float(seconds)
        except ValueError:
            out[name] = math.nan
        if not name or not math.isfinite(out[name]):
            raise InputError(f"--offset-s '{text}' is not understood; write SIDE=SECONDS: friday=12.5")
    return out


def register(app: typer.Typer) -> None:
    """Add the command to the console script."""
    app.command("compare", help=_HELP)(compare)
