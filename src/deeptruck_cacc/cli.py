"""`deeptruck-cacc`: the console script."""

from __future__ import annotations

import deeptruck_core.terminal.script_start  # noqa: F401 - Ctrl-C during the imports that follow

# isort: split
from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from deeptruck_core import files
from deeptruck_core.errors import InputError
from deeptruck_core.terminal import console
from deeptruck_core.terminal.progress import progress

if TYPE_CHECKING:
    from deeptruck_cacc.controllers.policy import MlpPolicy
    from deeptruck_cacc.training.settings import Config

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
Resume = Annotated[
    bool, typer.Option("--resume", help="Go on where a killed run of the same command stopped.")
]
Overwrite = Annotated[bool, typer.Option("--overwrite", help=files.OVERWRITE_HELP)]


class Trainer(StrEnum):
    """The training methods."""

    analytic = "analytic"
    trpo = "trpo"


WIDE = 130  # columns: narrower, rich cuts the numbers off
LARGEST_SEED = 2**31 - 1


@app.command()
def train(
    simulator: SimulatorPath,
    out: Annotated[Path, typer.Option(metavar="POLICY", help="Policy directory to write.")],
    trainer: Annotated[
        Trainer, typer.Option(help="analytic: gradient through the simulator; trpo: the paper's.")
    ] = Trainer.analytic,
    seed: Annotated[int, typer.Option(help="First seed.", min=0, max=LARGEST_SEED)] = 0,
    seeds: Annotated[int, typer.Option(help="Seeds side by side; 0: 3, or 1 with trpo.", min=0, max=100)] = 0,
    iterations: Annotated[int, typer.Option(help="Updates; 0 is the trainer's default.", min=0)] = 0,
    scene: Annotated[
        str, typer.Option(help="Training scenes: paper, graded, moving, wide, late; empty is the default.")
    ] = "",
    memory: Annotated[
        bool | None,
        typer.Option(help="Slow features (no steady-state error), or the paper's memoryless policy."),
    ] = None,
    printed_reward: Annotated[
        bool,
        typer.Option("--printed-reward", help="The reward as printed in the paper; with --trainer trpo."),
    ] = False,
    resume: Resume = False,
    overwrite: Overwrite = False,
) -> None:
    """Train a policy. About four minutes of one core with the default trainer.

    Example: deeptruck-cacc train --simulator simulators/mytruck --out policies/mytruck
    """
    from deeptruck_cacc import training
    from deeptruck_model import checks
    from deeptruck_model.results import apart

    settings = partial(_config, trainer, seed, seeds, iterations, scene, memory, printed_reward)
    place = partial(training.check_place, out, resume=resume, overwrite=overwrite)
    checks.every(settings, partial(apart, out, Path(simulator)), partial(checks.simulator, simulator), place)
    config = settings()
    begun = training.begun(out)
    if training.check(
        out, trainer=trainer.value, config=config, source=simulator, resume=resume, overwrite=overwrite
    ):
        typer.echo(f"{out}: finished before, with this simulator and these arguments; nothing was left to do")
        return
    if resume and not begun:
        typer.echo(f"note: {out} holds nothing to go on from; training from the beginning", err=True)
    policy = _trained(simulator, out, trainer.value, config, resume, overwrite)
    seed, score = policy.card["seed"], policy.card["validation"]["score"]
    typer.echo(f"{out}: trained; seed {seed} is best, with a validation cost of {score:.3f}")


def _trained(
    simulator: str, out: Path, trainer: str, config: Config, resume: bool, overwrite: bool
) -> MlpPolicy:
    from deeptruck_cacc import training
    from deeptruck_core.terminal.progress import bar
    from deeptruck_model import simulators

    truck = simulators.load(simulator)
    with bar("training") as show:
        return training.train(
            truck,
            out,
            trainer=trainer,
            config=config,
            resume=resume,
            overwrite=overwrite,
            source=simulator,
            progress=show,
        )


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
    from deeptruck_model import checks
    from deeptruck_model.results import apart

    if policy.startswith(("baseline:", "planner:")):
        raise InputError(f"{policy} is not a trained policy; only those have an ONNX form")
    checks.every(
        lambda: load_trained(Path(policy)), partial(files.check_new, out), partial(apart, out, Path(policy))
    )
    from deeptruck_cacc.controllers.export import export_onnx

    export_onnx(load_trained(Path(policy)), out)
    typer.echo(f"{out}: written")


def _config(
    trainer: Trainer,
    seed: int,
    seeds: int,
    iterations: int,
    scene: str,
    memory: bool | None,
    printed_reward: bool,
) -> Config:
    """The settings of a run; missing ones are the trainer's defaults."""
    from deeptruck_cacc.training.settings import AnalyticConfig, TrpoConfig

    kind: type[Config] = TrpoConfig if trainer is Trainer.trpo else AnalyticConfig
    if printed_reward and kind is AnalyticConfig:
        raise InputError("--printed-reward is the paper's, for --trainer trpo")
    given: dict[str, Any] = {"seed": seed}
    given |= {"printed_reward": True} if printed_reward else {}
    given |= {"seeds": seeds} if seeds else {}
    given |= {"iterations": iterations} if iterations else {}
    given |= {"scene": scene} if scene else {}
    given |= {"memory": memory} if memory is not None else {}
    return kind(**given)


console.moved(
    app, "sweep", "'deeptruck-cacc train --seeds N'; settings are fields of its configuration in Python"
)


def main() -> None:
    """Entry point."""
    console.run(app, "deeptruck-cacc")
