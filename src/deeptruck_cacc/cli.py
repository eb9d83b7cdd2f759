"""`deeptruck-cacc`: the console script."""

from __future__ import annotations

import deeptruck_core.terminal.script_start  # noqa: F401 - Ctrl-C during the imports that follow

# isort: split
import inspect
from copy import copy
from pathlib import Path
from typing import Annotated, Any, Literal, Optional

import typer

from deeptruck_cacc.training.settings import TRAINERS, options
from deeptruck_core import files
from deeptruck_core.errors import InputError
from deeptruck_core.terminal import console
from deeptruck_core.terminal.progress import bar, progress

app = typer.Typer(
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    add_completion=False,
    help="Train a car-following policy on a truck simulator, and show how it drives.",
)
PolicyPath = Annotated[
    str,
    typer.Argument(metavar="POLICY", help="Policy directory, baseline:acc|cacc|idm|pi, or planner:SIM."),
]
SimulatorPath = Annotated[
    str,
    typer.Option(
        "--simulator",
        metavar="SIM",
        help="Simulator directory, truck:NAME, python:MODULE:FACTORY or fmu:MODEL.fmu.",
    ),
]
Overwrite = Annotated[bool, typer.Option("--overwrite", help=files.OVERWRITE_HELP)]
WIDE = 130  # columns: narrower, rich cuts the numbers off
LARGEST_SEED = 2**31 - 1


def train(
    simulator: SimulatorPath,
    out: Annotated[Path, typer.Option(metavar="POLICY", help="Policy directory to write.")],
    trainer: Annotated[
        Literal["analytic", "trpo"],
        typer.Option(help="analytic: gradient through the simulator; trpo: the paper's."),
    ] = "analytic",
    overwrite: Overwrite = False,
    **settings: Any,
) -> None:
    """Train a policy. About four minutes of one core with the default trainer.

    Example: deeptruck-cacc train --simulator simulators/mytruck --out policies/mytruck
    """
    kind = TRAINERS[trainer]
    given = {name: value for name, value in settings.items() if value is not None}
    if foreign := given.keys() - {name for name, *_ in options(kind)}:
        raise InputError(f"--{min(foreign).replace('_', '-')} is no setting of --trainer {trainer}")
    config = kind(**given)
    from deeptruck_cacc import training

    with bar("training") as show:
        policy = training.train(simulator, out, config, overwrite=overwrite, progress=show)
    seed, score = policy.card["seed"], policy.card["validation"]["score"]
    typer.echo(f"{out}: trained; seed {seed} is best, with a validation cost of {score:.3f}")


def _as_options(command: Any) -> Any:
    """A command whose keyword arguments are the settings of all trainers, each None where it is not given."""
    found: dict[str, inspect.Parameter] = {}
    for trainer, kind in TRAINERS.items():
        for name, of, option, default in options(kind):
            if name in found:
                shared = found[name].annotation.__metadata__[0]
                shared.help += f" {trainer}: {default}."
                continue
            option = copy(option)
            option.help = f"{option.help} {trainer}: {default}."
            of = Annotated[Optional[of], option]  # noqa: UP045 - a type that is known at run time only
            found[name] = inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=None, annotation=of)
    named = inspect.signature(command, eval_str=True).parameters.values()
    own = [parameter for parameter in named if parameter.kind is not parameter.VAR_KEYWORD]
    command.__signature__ = inspect.Signature([*own, *found.values()])
    return command


app.command()(_as_options(train))


@app.command()
def evaluate(
    policy: PolicyPath,
    simulator: SimulatorPath,
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder for metrics.json and figures.")],
    rollouts: Annotated[int, typer.Option(help="Paths in each set.", min=1, max=10_000)] = 100,
    seed: Annotated[int, typer.Option(help="Of the scenes.", min=0, max=LARGEST_SEED)] = 1000,
    shield: Annotated[bool, typer.Option(help="Let the shield limit policy and baselines.")] = False,
    full: Annotated[bool, typer.Option("--full", help="Add every scene and the platoons.")] = False,
    overwrite: Overwrite = False,
) -> None:
    """Drive a policy and the baselines through the paper's scenes and field runs; write tables and figures.

    Example: deeptruck-cacc evaluate policies/mytruck --simulator truck:trucksim --out results/mytruck
    """
    from rich.console import Console

    from deeptruck_cacc import evaluation

    extent: dict[str, Any] = {"rollouts": rollouts, "seed": seed, "shield": shield, "full": full}
    with progress("loading") as say:
        metrics = evaluation.evaluate(policy, simulator, out, overwrite=overwrite, say=say, **extent)
    Console(width=max(Console().width, WIDE)).print(evaluation.table(metrics))
    typer.echo(f"metrics.json and figures in {out}; see {out / 'evaluation.html'}")


@app.command()
def export(
    policy: PolicyPath,
    out: Annotated[Path, typer.Option("--out", "--onnx", metavar="FILE.onnx", help="ONNX file to write.")],
) -> None:
    """Write a trained policy as ONNX, observation map and action scaling included.

    Example: deeptruck-cacc export policies/mytruck --out mytruck.onnx
    """
    from deeptruck_cacc.controllers.loading import load_trained
    from deeptruck_model.results import apart

    if policy.startswith(("baseline:", "planner:")):
        raise InputError(f"{policy} is not a trained policy; only those have an ONNX form")
    apart(out, Path(policy))
    files.check_new(out)
    trained = load_trained(Path(policy))
    from deeptruck_cacc.controllers.export import export_onnx

    export_onnx(trained, out)
    typer.echo(f"{out}: written")


console.moved(app, "sweep", "'deeptruck-cacc train --seeds N', one run for each setting")


def main() -> None:
    """Entry point."""
    console.run(app, "deeptruck-cacc")
