"""`deeptruck-model suggest`, `import`, `export`, `coverage` and `repair`: users' own logs and bags."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from deeptruck_core import files
from deeptruck_core.errors import InputError
from deeptruck_core.signals import shown, speed_unit
from deeptruck_core.terminal.progress import progress
from deeptruck_model import results
from deeptruck_model.cli.inputs import (
    ClockOption,
    MessageFiles,
    Overwrite,
    TopicMap,
    Units,
    show_accounts,
)
from deeptruck_model.recordings.bag_facts import Clock

if TYPE_CHECKING:
    from deeptruck_model.recordings import Suggestion, TableSuggestion

_IMPORT_HELP = """Turn a table (CSV, Parquet), a CAN log, or a bag with other topics into a bag of ours.

Examples:

  deeptruck-model import drive.csv --columns layouts/columns/veh002.yaml --out drive

  deeptruck-model import candump.log --columns truck.yaml --out drive

  deeptruck-model import mybag --columns topics.yaml --out drive
"""
_COVERAGE_HELP = """Show what bags hold: time over speed, acceleration and grade; channels, ranges, gaps.

Example:

  deeptruck-model coverage drive1 drive2 --out coverage
"""
_TABLE_HELP = """Write bags as one table, CSV or Parquet: a row per sample, channels in SI units on one clock.

Example:

  deeptruck-model table drive1 drive2 --out drives.parquet
"""
_SUGGEST_HELP = """List what a bag or table holds, and propose a topic map or COLUMNS.yaml for it.

Examples:

  deeptruck-model suggest mybag --out topics.yaml

  deeptruck-model train mybag --topic-map topics.yaml --out simulator

  deeptruck-model suggest drive.csv --out columns.yaml

  deeptruck-model import drive.csv --columns columns.yaml --out drive
"""
_REPAIR_HELP = """Make a bag whose recorder was killed whole again, in place.

A repaired copy takes the place of the .mcap file once it is complete, so there must be room for it, and
metadata.yaml is written. What is cut off the end is kept as NAME.mcap.cut, an older metadata.yaml as
metadata.yaml.before. No other file is touched, and a symbolic link is refused. End the recorder first.

Example:

  deeptruck-model repair drive
"""

Bags = Annotated[list[Path], typer.Argument(metavar="BAG...", help="rosbag2 folders or .mcap files")]


def register(app: typer.Typer) -> None:
    """Add this room's commands to the console script."""
    app.command("suggest", help=_SUGGEST_HELP)(suggest_map)
    app.command("import", help=_IMPORT_HELP)(import_log)
    app.command("table", help=_TABLE_HELP)(table_of)
    app.command("coverage", help=_COVERAGE_HELP)(show_coverage)
    app.command("repair", help=_REPAIR_HELP)(repair_bag)


def suggest_map(
    source: Annotated[
        Path,
        typer.Argument(metavar="BAG|TABLE", help="rosbag2 folder, .mcap, .db3 or .bag file; CSV or Parquet"),
    ],
    out: Annotated[
        Path | None, typer.Option(help="YAML file to write; without it the map is printed", metavar="FILE")
    ] = None,
    msg: MessageFiles = None,
) -> None:
    """List the content of a bag or table, and propose a channel for each number that may be one."""
    from deeptruck_model.recordings import importing, suggest, suggest_columns

    if out is not None:
        files.check_new(out)
        results.apart(out, source)
    table = importing.is_table(source)
    found: Suggestion | TableSuggestion = suggest_columns(source) if table else suggest(source, msg or ())
    # what is printed without --out is the file and nothing else, so that it may be redirected into one
    print("\n".join(found.listing()), file=sys.stdout if out else sys.stderr)
    what, option = ("columns", "--columns") if table else ("topic map", "--topic-map")
    if out is None:
        print(found.text(), end="")
    else:
        with files.new_file(out) as draft:
            draft.write_text(found.text(), encoding="utf-8")
        print(f"\nproposed {what}: {out}; check it, then give it as {option} {out}")
    for line in (*found.lacking, *found.doubts):
        print(f"note: {line}", file=sys.stderr)


def import_log(
    tables: Annotated[
        list[Path],
        typer.Argument(
            metavar="TABLE|CAN_LOG|BAG...", help="CSV, Parquet or MAT tables, CAN logs, or bags to convert"
        ),
    ],
    out: Annotated[
        Path, typer.Option(help="the bag to write, a new folder; of several sources the folder of their bags")
    ],
    columns: Annotated[
        Path | None,
        typer.Option(
            help="COLUMNS.yaml: what the columns mean; of a bag, its topic map; a CAN log needs none"
        ),
    ] = None,
    clock: ClockOption = None,
    msg: MessageFiles = None,
    slope_from: Annotated[
        str | None,
        typer.Option(
            help="what a derived grade is from: accelerometer (fused with elevation) or elevation; by "
            "default the first that the log has, where it has no grade"
        ),
    ] = None,
    overwrite: Overwrite = False,
) -> None:
    """Import tables, CAN logs or bags; several ones into bags of their names below `out`."""
    from deeptruck_model.recordings import importing
    from deeptruck_model.recordings.several import distinct

    names = distinct(tables)
    if twice := [t for t in tables if tables.count(t) > 1]:
        raise InputError(f"{twice[0]} is given twice; give each source once")
    if len(tables) > 1 and (same := [t for t in tables if Path(names[t]).is_absolute()]):
        raise InputError(f"several sources are called {same[0].stem}: rename them, or import each alone")
    if columns is None and (lacking := [t for t in tables if not importing.is_can_log(t)]):
        raise InputError(
            f"give --columns, what the columns of {lacking[0]} mean: 'deeptruck-model suggest {lacking[0]} "
            "--out columns.yaml' proposes it"
        )
    meaning: Path | dict[str, Any] = {} if columns is None else columns
    outs = [out] if len(tables) == 1 else [out / names[table] for table in tables]
    for table, place in zip(tables, outs, strict=True):
        importing.check(table, meaning, place, overwrite=overwrite, clock=clock)
    for table, place in zip(tables, outs, strict=True):
        if len(tables) > 1:
            place.parent.mkdir(parents=True, exist_ok=True)
        _import_one(table, meaning, place, clock, msg, slope_from, overwrite)


def _import_one(
    table: Path,
    columns: Path | dict[str, Any],
    out: Path,
    clock: Clock | None,
    msg: list[Path] | None,
    slope_from: str | None,
    overwrite: bool,
) -> None:
    from deeptruck_model.recordings import import_table

    done = import_table(
        table, columns, out, overwrite=overwrite, clock=clock, msg=msg or (), slope_from=slope_from
    )
    seconds = sum(len(r) * r.dt for r in done.recordings)
    pieces = len(done.recordings)
    print(f"{done.bag}: {seconds:.1f} s in {pieces} piece{'s' if pieces != 1 else ''}")
    print(f"channels: {', '.join(dict.fromkeys(c for r in done.recordings for c in r.channels))}")
    accounts = {id(r.account): r.account for r in done.recordings if r.account is not None}
    said = [line for account in accounts.values() for line in account.lines()]
    for line in said:
        print(line)
    for note in dict.fromkeys(note for r in done.recordings for note in r.notes):
        if f"  {note}" not in said:
            print(f"note: {note}")


def table_of(
    bags: Bags,
    out: Annotated[Path, typer.Option(help="table to write, a new .csv or .parquet file", metavar="FILE")],
    rate_hz: Annotated[
        float,
        typer.Option(help="Samples per second, at most those of the recorded speed.", min=0.1, max=1000),
    ] = 10.0,
    topic_map: TopicMap = None,
    clock: ClockOption = None,
    msg: MessageFiles = None,
) -> None:
    """Write the recordings of bags as a table."""
    results.apart(out, *bags)
    from deeptruck_model.recordings import check_table, read_all, write_table

    check_table(out)
    recordings = read_all(bags, topic_map=topic_map, rate_hz=rate_hz, clock=clock, msg=msg or ())
    show_accounts(recordings)
    write_table(out, recordings)
    samples = sum(map(len, recordings))
    print(f"{out}: {samples} rows of {len(recordings)} piece{'s' if len(recordings) != 1 else ''}")
    print(f"channels: {', '.join(dict.fromkeys(c for r in recordings for c in r.channels))}")


def show_coverage(
    bags: Bags,
    out: Annotated[Path, typer.Option(help="folder for coverage.json, .png and .html")],
    topic_map: TopicMap = None,
    clock: ClockOption = None,
    msg: MessageFiles = None,
    units: Units = "m/s",
    overwrite: Overwrite = False,
) -> None:
    """Draw what the bags hold."""
    results.apart(out, *bags)
    results.COVERAGE.check(out, overwrite=overwrite)
    speed_unit(units)
    from deeptruck_model.recordings import read_all

    with progress("reading") as say:

        def each(given: Sequence[str | Path]) -> Iterator[str | Path]:
            for number, bag in enumerate(given):
                say(f"reading {len(given)} bags, {number / len(given):.0%}")
                yield bag

        recordings = read_all(
            bags, topic_map=topic_map, clock=clock, mixed_clocks=True, msg=msg or (), progress=each
        )
        say("counting and drawing")
        from deeptruck_model.recordings import coverage
        from deeptruck_model.recordings.not_recorded import sentence

        found = coverage(recordings)
        found.save(out, overwrite=overwrite, units=units)
    for missing in found.not_recorded:
        print(f"not recorded: {sentence(missing)}")
    show_accounts(recordings)
    for (bag, dt), pieces in groupby(recordings, lambda r: (r.name.partition("#")[0], r.dt)):
        lengths = [len(piece) * dt for piece in pieces]
        several = f" in {len(lengths)} pieces" if len(lengths) > 1 else ""
        print(f"{bag}: {sum(lengths):.1f} s at {1 / dt:g} Hz{several}")
    print(shown(found.judgement, units))
    print(f"see {out / 'coverage.html'}")
    for line in found.warnings:
        print(f"warning: {line}", file=sys.stderr)


def repair_bag(bag: Annotated[Path, typer.Argument(help="the folder of the unfinished bag")]) -> None:
    """Repair one bag."""
    if not bag.exists():
        raise InputError(f"{bag} does not exist")
    from deeptruck_model.recordings import repair

    print(repair(bag) or f"{bag} is whole; nothing to do")
