"""Settings of the trainers, which are the options of `deeptruck-cacc train` too. Needs no torch."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, fields
from typing import Annotated, Any, get_type_hints

from typer import Option
from typer.models import OptionInfo

from deeptruck_cacc.environments import scenes
from deeptruck_core.errors import InputError

SEEDS = Annotated[int, Option(help="Policies trained side by side; the best in validation is kept.", min=1)]
SCENE = Annotated[str, Option(help=f"Training scenes: {', '.join(scenes.DRAWERS)}.")]
SEED = Annotated[int, Option(help="First seed; the others follow.", min=0, max=2**31 - 1)]
VALIDATE_EVERY = Annotated[int, Option(help="Iterations between validations.", min=1)]
MEMORY = Annotated[bool, Option(help="Slow features (no steady-state error), or the paper's five signals.")]


@dataclass(frozen=True)
class AnalyticConfig:
    """Settings of an analytic training run. Raises InputError for a value out of range or an unknown
    scene."""

    seed: SEED = 0
    seeds: SEEDS = 3
    iterations: Annotated[int, Option(help="Updates; those of trpo have a batch each.", min=0)] = 150
    scene: SCENE = "wide"
    memory: MEMORY = True
    validate_every: VALIDATE_EVERY = 15
    rollouts: Annotated[int, Option(help="Paths in a batch, for each seed.", min=1)] = 24
    window: Annotated[int, Option(help="Steps a gradient reaches back.", min=3)] = 200
    windows: Annotated[int, Option(help="Windows of a path before a fresh scene.", min=1)] = 2
    learning_rate: Annotated[
        float,
        Option(help="Of Adam, which falls to a fiftieth; 0: 3e-4, or 6e-3 without memory.", min=0, max=1e30),
    ] = 0.0
    clip: Annotated[float, Option(help="Largest gradient norm of one seed.", min=0)] = 1.0

    def __post_init__(self) -> None:
        check(self)

    @property
    def rate(self) -> float:
        """The learning rate. From random weights much must change; a start that already follows is only
        thrown off by such steps."""
        return self.learning_rate or (3e-4 if self.memory else 6e-3)


@dataclass(frozen=True)
class TrpoConfig:
    """Settings of a TRPO run. Batch, path, discount and network are the paper's; the others are ours. Raises
    InputError for a value out of range or an unknown scene."""

    seed: SEED = 0
    seeds: SEEDS = 1
    iterations: Annotated[int, Option(help="Batches.", min=1)] = 500
    scene: SCENE = "paper"
    memory: MEMORY = False
    validate_every: VALIDATE_EVERY = 10
    environments: Annotated[int, Option(help="Paths in a batch.", min=1)] = 25
    path: Annotated[int, Option(help="Steps of a path.", min=2)] = 800
    gamma: Annotated[float, Option(help="Discount.", min=0, max=1)] = 0.9999
    # whole returns, RLLab's default: at 0.97 an action is charged for 3 s, and a lost gap costs longer
    gae_lambda: Annotated[float, Option(help="Of the generalised advantage.", min=0, max=1)] = 1.0
    target_kl: Annotated[float, Option(help="Trust region, falling along a line to nothing.", min=0)] = 0.01
    log_std: Annotated[float, Option(help="Of the exploration at the start.", min=-10, max=10)] = -0.7
    printed_reward: Annotated[
        bool, Option("--printed-reward", help="The squares that the paper prints, and alpha_crash 100.")
    ] = False
    curvature_share: Annotated[
        float, Option(help="Share of the states on which the curvature is estimated.", min=0, max=1)
    ] = 0.1

    def __post_init__(self) -> None:
        check(self)


Config = AnalyticConfig | TrpoConfig
TRAINERS: dict[str, type[Config]] = {"analytic": AnalyticConfig, "trpo": TrpoConfig}


def options(kind: type[Config]) -> Iterator[tuple[str, Any, OptionInfo, Any]]:
    """(name, type, option, default) of each setting of a trainer."""
    hints = get_type_hints(kind, include_extras=True)
    for field in fields(kind):
        hint = hints[field.name]
        yield field.name, hint.__origin__, hint.__metadata__[0], field.default


def check(config: Config) -> None:
    """Raises InputError that names every setting out of range, and an unknown scene."""
    wrong = []
    for name, _, option, _ in options(type(config)):
        if option.min is None:
            continue
        value, most = getattr(config, name), math.inf if option.max is None else option.max
        if not option.min <= value <= most:  # nor NaN
            reach = f"at least {option.min:g}" if option.max is None else f"{option.min:g} to {most:g}"
            wrong.append(f"{name} is {value:g}; it must be {reach}")
    if config.scene not in scenes.DRAWERS:
        wrong.append(f"there is no scene '{config.scene}'; known: {', '.join(scenes.DRAWERS)}")
    if wrong:
        raise InputError("; ".join(wrong))
