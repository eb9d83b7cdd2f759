"""Repeat the paper's modelling experiments on the reference trucks."""

from __future__ import annotations

import sys
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer

from deeptruck_model import files
from deeptruck_model._terminal import console

app = typer.Typer(no_args_is_help=True, pretty_exceptions_enable=False, add_completion=False, help=__doc__)


class Mode(StrEnum):
    """Training recipes."""

    default = "default"
    paper = "paper"


Out = Annotated[
    Path, typer.Option(metavar="DIR", help="Folder; a subfolder of the experiment's name is written.")
]
Seeds = Annotated[int, typer.Option(help="Trucks trained; 0 takes the experiment's own number.", min=0)]
Budget = Annotated[int, typer.Option(help="Gradient updates of each; 0 chooses.", min=0)]
ModeOption = Annotated[Mode, typer.Option(help="paper: the paper's recipe.")]
Overwrite = Annotated[bool, typer.Option("--overwrite", help=files.OVERWRITE_HELP)]


BY_MODE = {
    "error-statistics": "Open-loop errors on 'trucksim': 4 h of training, 90 runs of 40 s on another 3 h.",
    "field": "The two field trucks with the paper's minutes of driving: ten runs of 15 s each.",
}
OF_DEFAULT = {
    "classics": "The deep truck beside ARX, NARX, gradient boosting and a fitted physics truck.",
    "minutes": "Errors after 5, 15 and 60 min of a truck's own driving, alone or after a fleet of others.",
}
"""Experiments that compare recipes, and those of our default alone."""


def _add_by_mode(name: str, says: str) -> None:
    @app.command(name, help=says)
    def command(
        out: Out,
        seeds: Seeds = 0,
        budget: Budget = 0,
        mode: ModeOption = Mode.default,
        overwrite: Overwrite = False,
    ) -> None:
        _experiment(name, out, seeds, budget, overwrite, mode=mode.value)


def _add_of_default(name: str, says: str) -> None:
    @app.command(name, help=says)
    def command(out: Out, seeds: Seeds = 0, budget: Budget = 0, overwrite: Overwrite = False) -> None:
        _experiment(name, out, seeds, budget, overwrite)


for _name, _says in BY_MODE.items():
    _add_by_mode(_name, _says)
for _name, _says in OF_DEFAULT.items():
    _add_of_default(_name, _says)


def _experiment(name: str, out: Path, seeds: int, budget: int, overwrite: bool, **settings: Any) -> None:
    from benchmarks.paper.results import EXPERIMENT

    EXPERIMENT.check(out / name, overwrite=overwrite)
    settings |= {"seeds": seeds} if seeds else {}
    with EXPERIMENT.replacing(out / name, overwrite=overwrite) as draft:
        from benchmarks.paper.experiments import EXPERIMENTS

        EXPERIMENTS[name](draft, updates=budget, **settings)
    typer.echo(f"written: {out / name}")


def start() -> None:
    """Entry point."""
    console.run(app, "benchmarks/paper/run.py")


if __name__ == "__main__":
    sys.path[0] = str(Path(__file__).resolve().parents[2])  # where `benchmarks` is a package
    start()
