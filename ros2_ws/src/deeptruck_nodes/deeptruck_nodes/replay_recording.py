"""Play a bag back onto its topics, with /clock."""

from __future__ import annotations

import deeptruck_model.script_start  # noqa: F401 - Ctrl-C during the imports that follow

# isort: split
from pathlib import Path
from typing import Annotated

import typer

from deeptruck_model import console
from deeptruck_model.files import OVERWRITE_HELP
from deeptruck_nodes import runs

EXAMPLES = """
Examples:\n
  deeptruck-replay drive\n
  deeptruck-replay drive --speed 10 --start 60 --topic /truck/twist --topic /truck/command
"""


def main(
    bag: Annotated[
        Path, typer.Argument(help="Bag to play; one whose recorder was killed is repaired first.")
    ],
    speed: Annotated[float, typer.Option(help="How much faster than recorded.")] = 1.0,
    start: Annotated[float, typer.Option(help="Where to begin, s.")] = 0.0,
    topic: Annotated[
        list[str] | None, typer.Option(help="Only this topic; may be given more than once.")
    ] = None,
    record: Annotated[Path | None, typer.Option(help="Record what is played; a new folder.")] = None,
    overwrite: Annotated[bool, typer.Option(help=OVERWRITE_HELP)] = False,
    monitor: Annotated[
        str, typer.Option(help="Simulator to compare the played truck with: /mismatch/residual.")
    ] = "",
    page: Annotated[
        bool, typer.Option("--page", help="Show the run in a browser on this machine; prints the address.")
    ] = False,
    parameters: Annotated[Path | None, typer.Option(help="Parameter file; wins over the options.")] = None,
    run_folders: Annotated[Path, typer.Option("--runs", help="Where the folder of this run goes.")] = Path(
        "runs"
    ),
) -> None:
    """Play a bag back onto its topics, with /clock, in recorded time or faster."""
    given = {"replay": {"bag": str(bag.absolute()), "speed": speed, "start_s": start, "topics": topic or []}}
    common = runs.Common(record, overwrite, parameters, run_folders, monitor, page)
    raise typer.Exit(runs.replay(common, given))


def start(program: str = "deeptruck-replay") -> None:
    """The console script; a script of the workspace calls itself otherwise."""
    app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
    app.command(epilog=EXAMPLES)(main)
    console.run(app, program)
