"""Start command: plays a bag on its topics, with /clock."""

from __future__ import annotations

import deeptruck_core.terminal.script_start  # noqa: F401 - Ctrl-C during the imports that follow

# isort: split
from pathlib import Path
from typing import Annotated

import typer

from deeptruck_nodes import options, runs

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
    overwrite: options.Overwrite = False,
    page: options.Page = False,
    parameters: options.Parameters = None,
    run_folders: options.RunFolders = options.RUNS,
) -> None:
    """Play a bag back onto its topics, with /clock, in recorded time or faster."""
    given = {"replay": {"bag": str(bag.absolute()), "speed": speed, "start_s": start, "topics": topic or []}}
    common = runs.Common(record, overwrite, parameters, run_folders, page)
    raise typer.Exit(runs.replay(common, given))


def start(program: str = "deeptruck-replay") -> None:
    """The console script; the script of the ROS 2 workspace passes its own name as `program`."""
    options.start(main, EXAMPLES, program)
