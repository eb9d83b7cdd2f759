"""`deeptruck-model import`, `coverage` and `repair`: what users do with their own logs and bags."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from deeptruck_model import checks, results
from deeptruck_model.cli.inputs import Overwrite
from deeptruck_model.errors import InputError

_IMPORT_HELP = """Turn a table (CSV, Parquet) or a CAN log into a bag, as COLUMNS.yaml says.

Examples:

  deeptruck-model import drive.csv --columns layouts/columns/veh002.yaml --out drive

  deeptruck-model import candump.log --columns truck.yaml --out drive
"""
_COVERAGE_HELP = """Show what bags hold: time over speed, acceleration and grade; channels, ranges, gaps.

Example:

  deeptruck-model coverage drive1 drive2 --out coverage
"""
_REPAIR_HELP = """Make a bag whose recorder was killed whole again, in place.

A mended copy takes the place of the .mcap file once it is complete, so there must be room for it, and
metadata.yaml is written. What is cut off the end is kept as NAME.mcap.cut, an older metadata.yaml as
metadata.yaml.before. No other file is touched. End the recorder first.

Example:

  deeptruck-model repair drive
"""

Bags = Annotated[list[Path], typer.Argument(metavar="BAG...", help="rosbag2 folders or .mcap files")]


def register(app: typer.Typer) -> None:
    """Add this room's commands to the console script."""
    app.command("import", help=_IMPORT_HELP)(import_log)
    app.command("coverage", help=_COVERAGE_HELP)(show_coverage)
    app.command("repair", help=_REPAIR_HELP)(repair_bag)


def import_log(
    table: Annotated[Path, typer.Argument(metavar="TABLE|CAN_LOG", help="CSV or Parquet table, or CAN log")],
    columns: Annotated[Path, typer.Option(help="COLUMNS.yaml: what the columns mean")],
    out: Annotated[Path, typer.Option(help="the bag to write, a new folder")],
    overwrite: Overwrite = False,
) -> None:
    """Import one table or CAN log."""
    from deeptruck_model.recordings import import_checks

    import_checks.check(table, columns, out, overwrite=overwrite)
    from deeptruck_model.recordings import import_table

    done = import_table(table, columns, out, overwrite=overwrite)
    seconds = sum(len(r) * r.dt for r in done.recordings)
    pieces = len(done.recordings)
    print(f"{done.bag}: {seconds:.1f} s in {pieces} piece{'s' if pieces != 1 else ''}")
    print(f"channels: {', '.join(dict.fromkeys(c for r in done.recordings for c in r.channels))}")
    for note in dict.fromkeys(note for r in done.recordings for note in r.notes):
        print(f"note: {note}")
    if done.sealed is not None:
        print(f"sealed: {done.sealed} sha256 {done.sha256}")


def show_coverage(
    bags: Bags,
    out: Annotated[Path, typer.Option(help="folder for coverage.json and coverage.png")],
    topic_map: Annotated[Path | None, typer.Option(help="YAML that maps channels to your topics")] = None,
    overwrite: Overwrite = False,
) -> None:
    """Draw what the bags hold."""
    checks.every(
        lambda: results.apart(out, *bags),
        lambda: results.COVERAGE.check(out, overwrite=overwrite),
        lambda: checks.inputs(None, bags, mapped=topic_map is not None),
        *([lambda: _check_map(topic_map)] if topic_map else []),
    )
    from rich.progress import track

    from deeptruck_model.recordings import coverage, read

    read_bags = track(bags, description="reading", disable=len(bags) < 2)
    recordings = [recording for bag in read_bags for recording in read(bag, topic_map=topic_map)]
    found = coverage(recordings)
    found.save(out, overwrite=overwrite)
    for recording in found.recordings:
        print(f"{recording['name']}: {recording['duration_s']:.1f} s at {1 / recording['dt']:g} Hz")
    print(f"{found.duration_s / 3600:.3f} h; see {out / 'coverage.png'} and coverage.json")
    for line in found.warnings:
        print(f"warning: {line}", file=sys.stderr)


def _check_map(topic_map: Path) -> None:
    from deeptruck_model.recordings.topic_map import load

    load(topic_map)


def repair_bag(bag: Annotated[Path, typer.Argument(help="the folder of the unfinished bag")]) -> None:
    """Mend one bag."""
    if not bag.exists():
        raise InputError(f"{bag} does not exist")
    from deeptruck_model.recordings import repair

    print(repair(bag) or f"{bag} is whole; nothing to do")
