"""The real truck's table as two bags: its first part to learn from, its last part to be judged by."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated

import typer

from deeptruck_core import files
from deeptruck_core.terminal import console
from deeptruck_model.recordings import import_table, split, write_bag

COLUMNS = Path(__file__).parents[2] / "layouts" / "columns" / "veh002.yaml"
DRIVES = files.Result("a folder of the real truck's drives")


def main(
    table: Annotated[Path, typer.Argument(help="veh002_all.csv")],
    out: Annotated[Path, typer.Option(help="Folder for the bags train and test.")],
    overwrite: Annotated[bool, typer.Option("--overwrite", help=files.OVERWRITE_HELP)] = False,
) -> None:
    """Import and split by time: 80 % to learn from (the trainer validates within), the last 20 % to test."""
    with DRIVES.replacing(out, overwrite=overwrite) as draft, TemporaryDirectory() as scratch:
        recordings = import_table(table, COLUMNS, Path(scratch) / "whole").recordings
        first, _, last = split(recordings, (0.8, 0.0, 0.2))
        for name, part in (("train", first), ("test", last)):
            write_bag(draft / name, part, interface=recordings[0].interface)
            print(f"{name}: {sum(len(r) * r.dt for r in part) / 60:.0f} min in {len(part)} pieces")


if __name__ == "__main__":
    app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
    app.command()(main)
    console.run(app, "real")
