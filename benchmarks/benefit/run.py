"""Measure the closed-loop benefit of a corrected simulator: policies trained on the simulator as given, on
the corrected one and on the truth drive the true truck."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from deeptruck_model import files
from deeptruck_model._terminal import console

app = typer.Typer(pretty_exceptions_enable=False, add_completion=False)


@app.command(help=f"{__doc__}\n\nAbout an hour of one core.")
def main(
    out: Annotated[
        Path, typer.Option(metavar="DIR", help="Folder for benefit.md, benefit.png, benefit.json, work/.")
    ],
    effect: Annotated[
        list[str] | None, typer.Option(help="Effect; repeat for several. Default: all of them.")
    ] = None,
    recipe: Annotated[
        list[str] | None, typer.Option(help="default, trusting or gentle; repeat. Default: all.")
    ] = None,
    seeds: Annotated[int, typer.Option(help="Policies of each simulator.", min=1)] = 3,
    iterations: Annotated[int, typer.Option(help="Updates of each training.", min=1)] = 90,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on where a killed run of the same command stopped.")
    ] = False,
    overwrite: Annotated[bool, typer.Option("--overwrite", help=files.OVERWRITE_HELP)] = False,
) -> None:
    from benchmarks.benefit import plan

    effects, recipes = effect or plan.EFFECTS, recipe or tuple(plan.RECIPES)
    plan.check(out, effects, recipes, resume=resume, overwrite=overwrite)
    from benchmarks.benefit.experiment import benefit

    effort = plan.Effort(seeds=seeds, iterations=iterations)
    benefit(
        out,
        effects,
        recipes,
        effort,
        resume=resume,
        overwrite=overwrite,
        say=lambda line: typer.echo(line, err=True),
    )
    typer.echo(f"{out}: benefit.md, benefit.png and benefit.json")


def start() -> None:
    """Entry point."""
    console.run(app, "benchmarks/benefit/run.py")


if __name__ == "__main__":
    sys.path[0] = str(Path(__file__).resolve().parents[2])  # where `benchmarks` is a package
    start()
