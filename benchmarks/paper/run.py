"""Repeat the paper's experiments on the reference trucks, and write its figures and numbers beside ours."""

from __future__ import annotations

import sys
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer

from deeptruck_model import console, files

app = typer.Typer(no_args_is_help=True, pretty_exceptions_enable=False, add_completion=False, help=__doc__)


class Mode(StrEnum):
    """Training recipes."""

    default = "default"
    paper = "paper"


class Chain(StrEnum):
    """Ways to train a policy, and the recipe of the deep truck it is trained on."""

    paper = "paper"
    trpo = "trpo"
    default = "default"
    unaided = "unaided"


Out = Annotated[
    Path, typer.Option(metavar="DIR", help="Folder; a subfolder of the experiment's name is written.")
]
Seeds = Annotated[int, typer.Option(help="Trucks trained; 0 takes the experiment's own number.", min=0)]
Budget = Annotated[int, typer.Option(help="Gradient updates of each; 0 chooses.", min=0)]
ModeOption = Annotated[Mode, typer.Option(help="paper: the paper's recipe.")]
Overwrite = Annotated[bool, typer.Option("--overwrite", help=files.OVERWRITE_HELP)]
PageOut = Annotated[Path, typer.Option(metavar="DIR", help="Folder; the page is in its subfolder 'paper'.")]


@app.command()
def error_statistics(
    out: Out,
    seeds: Seeds = 0,
    budget: Budget = 0,
    mode: ModeOption = Mode.default,
    overwrite: Overwrite = False,
) -> None:
    """Open-loop errors on 'trucksim': 4 h of training, 90 runs of 40 s on another 3 h."""
    _experiment("error-statistics", out, seeds, budget, overwrite, mode=mode.value)


@app.command()
def field(
    out: Out,
    seeds: Seeds = 0,
    budget: Budget = 0,
    mode: ModeOption = Mode.default,
    overwrite: Overwrite = False,
) -> None:
    """The two field trucks with the paper's minutes of driving: ten runs of 15 s each."""
    _experiment("field", out, seeds, budget, overwrite, mode=mode.value)


@app.command()
def classics(out: Out, seeds: Seeds = 0, budget: Budget = 0, overwrite: Overwrite = False) -> None:
    """The deep truck beside ARX, NARX, gradient boosting and a fitted physics truck."""
    _experiment("classics", out, seeds, budget, overwrite)


@app.command()
def minutes(out: Out, seeds: Seeds = 0, budget: Budget = 0, overwrite: Overwrite = False) -> None:
    """Errors after 5, 15 and 60 min of a truck's own driving, alone or after a fleet of others."""
    _experiment("minutes", out, seeds, budget, overwrite)


def _experiment(name: str, out: Path, seeds: int, budget: int, overwrite: bool, **settings: Any) -> None:
    from benchmarks.paper.results import EXPERIMENT

    EXPERIMENT.check(out / name, overwrite=overwrite)
    settings |= {"seeds": seeds} if seeds else {}
    with EXPERIMENT.replacing(out / name, overwrite=overwrite) as draft:
        from benchmarks.paper.experiments import EXPERIMENTS

        EXPERIMENTS[name](draft, updates=budget, **settings)
    typer.echo(f"written: {out / name}")


@app.command()
def modelling(
    out: PageOut,
    seeds: Seeds = 0,
    budget: Budget = 0,
    workers: Annotated[int, typer.Option(help="Trucks trained side by side.", min=1)] = 1,
) -> None:
    """The page paper.md, its modelling half: trucks of three recipes. A stopped run is continued."""
    from benchmarks.paper import modelling as half
    from benchmarks.paper.results import PAPER_PAGE

    folder = out / "paper"
    half.experiment(folder, seeds, budget, workers, say=lambda line: typer.echo(line, err=True))
    typer.echo(f"written: {folder / PAPER_PAGE}")


@app.command()
def control(
    out: PageOut,
    seeds: Annotated[int, typer.Option(help="Policies of each trainer.", min=1, max=100)] = 10,
    iterations: Annotated[int, typer.Option(help="Updates of each training; 0: the trainer's.", min=0)] = 0,
    chain: Annotated[
        list[Chain] | None, typer.Option(help="Repeat for several. Default: all of them.")
    ] = None,
) -> None:
    """The page paper.md, its control half: TRPO as printed beside our trainer, on deep trucks and the truck.

    A deep truck that the modelling half has not trained yet is trained first. A stopped run is continued.
    """
    from benchmarks.paper import control as half
    from benchmarks.paper.results import PAPER_PAGE

    folder = out / "paper"
    chains = tuple(one.value for one in chain or Chain)
    half.experiment(folder, seeds, iterations, chains, say=lambda line: typer.echo(line, err=True))
    typer.echo(f"written: {folder / PAPER_PAGE}")


def start() -> None:
    """Entry point."""
    console.run(app, "benchmarks/paper/run.py")


if __name__ == "__main__":
    sys.path[0] = str(Path(__file__).resolve().parents[2])  # where `benchmarks` is a package
    start()
