"""`deeptruck-cacc`: the console script."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from deeptruck_cacc.training_bar import telling
from deeptruck_model import console
from deeptruck_model.errors import InputError

app = typer.Typer(
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    help="Train a car-following policy on a truck simulator, and show how it drives.",
)
PolicyPath = Annotated[
    str, typer.Argument(metavar="POLICY", help="Policy directory, or baseline:acc|cacc|idm|pi|mpc.")
]
SimulatorPath = Annotated[
    str, typer.Option("--simulator", metavar="SIM", help="Simulator directory, or truck:NAME.")
]


class Trainer(StrEnum):
    """Ways to train."""

    analytic = "analytic"
    trpo = "trpo"


WIDE = 130  # columns: narrower, rich cuts the numbers off


class Engine(StrEnum):
    """Where a sweep trains."""

    processes = "processes"
    ray = "ray"


@app.command()
def train(
    simulator: SimulatorPath,
    out: Annotated[Path, typer.Option(metavar="POLICY", help="Policy directory to write.")],
    trainer: Annotated[
        Trainer, typer.Option(help="analytic: back through the simulator; trpo: the paper's.")
    ] = Trainer.analytic,
    seed: Annotated[int, typer.Option(help="First seed.", min=0)] = 0,
    seeds: Annotated[int, typer.Option(help="Seeds side by side; 0: 3, or 1 with trpo.", min=0, max=100)] = 0,
    iterations: Annotated[int, typer.Option(help="Updates; 0 is the trainer's default.", min=0)] = 0,
    scene: Annotated[
        str, typer.Option(help="Training scenes: paper, graded, moving, wide; empty is the default.")
    ] = "",
    memory: Annotated[
        bool | None, typer.Option(help="Slow features (no steady error), or the paper's memoryless policy.")
    ] = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on where a killed run of the same command stopped.")
    ] = False,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace a policy that is there.")] = False,
) -> None:
    """Train a policy. About a minute of one core with the default trainer.

    Example: deeptruck-cacc train --simulator simulators/mytruck --out policies/mytruck
    """
    from deeptruck_cacc import training
    from deeptruck_model import simulators

    check_target(out)
    if (out / "policy.json").exists() and not (resume or overwrite):
        raise InputError(f"{out} holds a policy already; choose another --out, or add --overwrite")
    if training.begun(out) and not (resume or overwrite):
        raise InputError(
            f"{out} is an unfinished training; add --resume to go on with it, or --overwrite to begin anew"
        )
    config = _config(trainer, seed, seeds, iterations, scene, memory)
    if resume and training.finished(out, trainer=trainer.value, config=config, source=simulator):
        typer.echo(f"{out}: finished before, with this simulator and these arguments; nothing was left to do")
        return
    truck = simulators.load(simulator)
    if resume and not training.begun(out):
        typer.echo(f"note: {out} holds nothing to go on from; training from the beginning", err=True)
    with telling() as tell:
        policy = training.train(
            truck,
            out,
            trainer=trainer.value,
            config=config,
            resume=resume,
            source=simulator,
            tell=tell,
        )
    typer.echo(f"{out}: seed {policy.card['seed']}, validation {policy.card['validation']['score']:.3f}")


@app.command()
def evaluate(
    policy: PolicyPath,
    simulator: SimulatorPath,
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder for metrics.json and figures.")],
    rollouts: Annotated[int, typer.Option(help="Paths in each set.", min=1)] = 100,
    seed: Annotated[int, typer.Option(help="Of the scenes.", min=0)] = 1000,
    shield: Annotated[bool, typer.Option(help="Put the shield between policy and truck.")] = False,
    full: Annotated[
        bool, typer.Option("--full", help="Add every scene, the baselines' table and the platoons.")
    ] = False,
    all_seeds: Annotated[
        bool, typer.Option("--all-seeds", help="Every POLICY/seeds/K, and the worst of them.")
    ] = False,
) -> None:
    """Drive a policy through the paper's scenes and field runs; write tables and figures.

    Example: deeptruck-cacc evaluate policies/mytruck --simulator truck:trucksim --out results/mytruck
    """
    from deeptruck_cacc import evaluation

    drive = evaluation.evaluate_seeds if all_seeds else evaluation.evaluate
    metrics = drive(policy, simulator, out, rollouts=rollouts, seed=seed, shield=shield, full=full)
    seen = Console()
    Console(width=max(seen.width, WIDE)).print(evaluation.table(metrics))
    typer.echo(f"{out}: metrics.json and figures")


@app.command()
def export(
    policy: PolicyPath,
    out: Annotated[Path, typer.Option(metavar="FILE.onnx", help="ONNX file to write.")],
) -> None:
    """Write a trained policy as ONNX, observation map and action scaling included.

    Example: deeptruck-cacc export policies/mytruck --out mytruck.onnx
    """
    from deeptruck_cacc.export import export_onnx
    from deeptruck_cacc.policy import MlpPolicy, load_policy

    loaded = load_policy(policy)
    if not isinstance(loaded, MlpPolicy):
        raise InputError(f"{policy} is not a trained policy; only those have an ONNX form")
    if out.exists() and out.suffix != ".onnx":
        raise InputError(f"{out} exists and is no .onnx file; choose another --out")
    export_onnx(loaded, out)
    typer.echo(f"{out}: written")


@app.command()
def pays(
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder for pays.md, pays.png, pays.json, work/.")],
    effect: Annotated[
        list[str] | None, typer.Option(help="Effect; repeat for several. Default: all of them.")
    ] = None,
    recipe: Annotated[
        list[str] | None, typer.Option(help="default, trusting or gentle; repeat. Default: all.")
    ] = None,
    seeds: Annotated[int, typer.Option(help="Policies of each simulator.", min=1)] = 3,
    iterations: Annotated[int, typer.Option(help="Updates of each training.", min=1)] = 90,
) -> None:
    """Does correcting the simulator pay? Train on the old and the corrected one, drive the true truck.

    About an hour of one core; a killed run goes on where it stopped.

    Example: deeptruck-cacc pays --out results/pays --effect payload --recipe trusting
    """
    from deeptruck_cacc import pays as experiment

    effort = experiment.Effort(seeds=seeds, iterations=iterations)
    say = Console(stderr=True)
    experiment.pays(
        out, effect or tuple(experiment.CASES), recipe or tuple(experiment.RECIPES), effort, tell=say.print
    )
    typer.echo(f"{out}: pays.md, pays.png and pays.json")


@app.command()
def sweep(
    simulator: SimulatorPath,
    out: Annotated[
        Path, typer.Option(metavar="DIR", help="Folder for the policies, sweep.md and sweep.json.")
    ],
    set_: Annotated[
        list[str], typer.Option("--set", metavar="NAME=A,B", help="Values of a setting; repeat for a grid.")
    ],
    trainer: Annotated[Trainer, typer.Option(help="analytic or trpo.")] = Trainer.analytic,
    workers: Annotated[int, typer.Option(help="Processes side by side.", min=1)] = 1,
    engine: Annotated[
        Engine, typer.Option(help="ray: on the cluster that RAY_ADDRESS names; extra 'ray'.")
    ] = Engine.processes,
) -> None:
    """Train a grid of settings and seeds, and rank them by validation. A killed sweep goes on.

    Example: deeptruck-cacc sweep --simulator SIM --out rates --set learning_rate=0.003,0.006 --workers 2
    """
    from deeptruck_cacc import sweep as sweeping
    from deeptruck_model.sweeps import read_grid

    grid, kind, where = read_grid(set_), trainer.value, engine.value
    say = Console(stderr=True).print
    sweeping.sweep(simulator, out, grid, trainer=kind, workers=workers, engine=where, tell=say)
    typer.echo((out / "sweep.md").read_text())


def check_target(out: Path) -> None:
    """Refuse to write a policy over something else."""
    ours = ("policy.json", "checkpoint", "learning_curve.jsonl")
    if out.exists() and not (
        out.is_dir() and (not any(out.iterdir()) or any((out / name).exists() for name in ours))
    ):
        raise InputError(f"{out} exists and is not a policy directory; choose another --out")


def _config(
    trainer: Trainer, seed: int, seeds: int, iterations: int, scene: str, memory: bool | None
) -> object:
    chosen: dict[str, object] = {"seed": seed}
    if seeds:
        chosen["seeds"] = seeds
    if iterations:
        chosen["iterations"] = iterations
    if scene:
        chosen["scene"] = scene
    if memory is not None:
        chosen["memory"] = memory
    if trainer is Trainer.analytic:
        from deeptruck_cacc.training.analytic import AnalyticConfig

        return AnalyticConfig(**chosen)  # type: ignore[arg-type]
    if seeds > 1:
        from deeptruck_cacc.training.trpo_seeds import TrpoSeedsConfig

        return TrpoSeedsConfig(**chosen)  # type: ignore[arg-type]
    from deeptruck_cacc.training.trpo import TrpoConfig

    chosen.pop("seeds", None)
    return TrpoConfig(**chosen)  # type: ignore[arg-type]


def main() -> None:
    """Entry point."""
    console.run(
        app,
        "deeptruck-cacc",
        interrupted="interrupted; --resume goes on from the last checkpoint, where there is one",
    )
