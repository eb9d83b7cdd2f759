"""`deeptruck-model fleet`: a command for each of many trucks, here or on a Ray cluster."""

from __future__ import annotations

import os
import sys
from itertools import takewhile
from pathlib import Path
from typing import Annotated, Any

import typer

from deeptruck_core.errors import InputError
from deeptruck_model.results import FLEET, apart

COMMANDS = ("import", "train", "mismatch")
SHOWN = 10  # files left out that are listed
_HELP = """Import, train or compare many trucks: one command for each, here or on a Ray cluster.

Each PATH is a truck, a folder of its logs or bags. Results are OUT/TRUCK, and OUT/fleet.html has a row for
each. What fails is listed at the end, and the others go on; given again, the command does what is not done.
Options of the command stand after the paths; {truck} in them is the truck's name.

Examples:

  deeptruck-model fleet import logs/*/ --columns columns.yaml --out drives

  deeptruck-model fleet train drives/*/ --seeds 3 --out simulators

  deeptruck-model fleet mismatch drives/*/ --simulator truck:trucksim --out found --ray 10.0.0.1:6379
"""


def fleet(
    context: typer.Context,
    words: Annotated[list[str], typer.Argument(metavar="import|train|mismatch PATH... [OPTION...]")],
    out: Annotated[Path, typer.Option(help="Folder of the results.", metavar="OUT")],
    ray: Annotated[
        str | None,
        typer.Option(
            help="Address of a Ray cluster, HOST:PORT; 'local' starts Ray on this machine.", metavar="ADDRESS"
        ),
    ] = None,
    jobs: Annotated[int, typer.Option(help="Trucks at a time on this machine; 0: one a core.", min=0)] = 0,
    seeds: Annotated[int, typer.Option(help="With train: simulators of each truck, seeds 0 on.", min=0)] = 0,
) -> None:
    command, *given = words
    if command not in COMMANDS:
        raise InputError(
            f"'fleet {command}' is no command; write 'fleet import', 'fleet train' or 'fleet mismatch'"
        )
    paths = [Path(word) for word in takewhile(lambda word: not word.startswith("-"), given)]
    if not paths:
        raise InputError(f"give the trucks first: 'fleet {command} drives/*/ --out {out}'")
    if seeds and command != "train":
        raise InputError("--seeds is for 'fleet train'")
    from deeptruck_model.fleet import jobs as planned

    FLEET.check(out, overwrite=True)
    apart(out, *paths)
    todo, others = planned.jobs(command, paths, out, given[len(paths) :], seeds)
    group: Any = context.find_root().command
    group.commands[command].make_context(command, list(todo[0].line[1:]))  # refuses an unknown option
    if others:
        names = ", ".join(map(str, others[:SHOWN]))
        print(f"note: {len(others)} files that are no bags are left out: {names}", file=sys.stderr)
    from deeptruck_model.fleet.run import PAGE, run

    failed = run(todo, out, workers=jobs or os.cpu_count() or 1, ray=ray)
    print(f"{len(todo) - len(failed)} of {len(todo)} done; see {out / PAGE}")
    for job, why in failed:
        print(f"{job.name}: {why}", file=sys.stderr)
    if failed:
        raise InputError(f"{len(failed)} of {len(todo)} failed; the same command tries them again")


def register(app: typer.Typer) -> None:
    """Add the command to the console script."""
    app.command(
        "fleet", help=_HELP, context_settings={"ignore_unknown_options": True, "allow_extra_args": True}
    )(fleet)
