"""Options shared by the three start commands, and their console scripts."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Literal

import typer

from deeptruck_core.files import OVERWRITE_HELP
from deeptruck_core.terminal import console

RUNS = Path("runs")

Policy = Annotated[str, typer.Option(help="Policy directory, baseline:NAME, or planner:SIM.")]
TimeGap = Annotated[float, typer.Option(help="To hold, s.")]
Errors = Literal["clean", "noisy", "field"]
RadarLostAt = Annotated[
    float,
    typer.Option(help="When the simulated radar loses the leader, s from the start; 0: never.", min=0.0),
]
RadarLostFor = Annotated[float, typer.Option(help="For how long it sees nothing, s.", min=0.01)]
InitialGap = Annotated[float, typer.Option(help="m; 0: a time gap of 2 s.")]
Record = Annotated[Path | None, typer.Option(help="Bag to record; a new folder.")]
Overwrite = Annotated[bool, typer.Option(help=OVERWRITE_HELP)]
Page = Annotated[
    bool, typer.Option("--page", help="Show the run in a browser on this machine; prints the address.")
]
Parameters = Annotated[Path | None, typer.Option(help="Parameter file; wins over the options.")]
RunFolders = Annotated[Path, typer.Option("--runs", help="Where the folder of this run goes.")]


def start(main: Callable[..., None], examples: str, program: str) -> None:
    """Run `main` as the console script `program`; `examples` stand at the end of its help."""
    app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
    app.command(epilog=examples)(main)
    console.run(app, program)
