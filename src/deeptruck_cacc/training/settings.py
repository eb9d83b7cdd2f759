"""Settings of the trainers and their limits, checked before anything is driven or written. Needs no torch."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from math import inf

from deeptruck_cacc.environments import scenes
from deeptruck_core.errors import InputError

MOST_RATE = 1e30  # beyond, the optimiser's own numbers overflow
# From random weights much must change; a start that already follows is only thrown off by such steps.
FOLLOWER_RATE, RANDOM_RATE = 3e-4, 6e-3
ANALYTIC = {
    "seed": (0, inf), "seeds": (1, inf), "rollouts": (1, inf), "iterations": (0, inf), "window": (3, inf),
    "windows": (1, inf), "learning_rate": (0, MOST_RATE), "clip": (0, inf), "validate_every": (1, inf),
}  # fmt: skip
TRPO = {
    "seed": (0, inf), "iterations": (1, inf), "environments": (1, inf), "path": (2, inf), "gamma": (0, 1),
    "gae_lambda": (0, 1), "target_kl": (0, inf), "log_std": (-10, 10), "validate_every": (1, inf),
    "seeds": (1, inf), "curvature_share": (0, 1),
}  # fmt: skip


@dataclass(frozen=True)
class AnalyticConfig:
    """Settings of an analytic training run."""

    seed: int = 0
    """first seed; the others follow"""
    seeds: int = 3
    """policies trained side by side"""
    rollouts: int = 24
    """paths in a batch, for each seed"""
    iterations: int = 150
    """gradient steps"""
    window: int = 200
    """steps a gradient reaches back"""
    windows: int = 2
    """windows of a path before a fresh scene"""
    learning_rate: float = 0.0
    """Adam, falling to a fiftieth along a cosine; 0: FOLLOWER_RATE with memory, RANDOM_RATE without"""
    clip: float = 1.0
    """largest gradient norm of one seed"""
    scene: str = "wide"
    """training scenes"""
    memory: bool = True
    """slow features (see FeatureMap) and never both pedals; False is the paper's memoryless policy"""
    validate_every: int = 15
    """iterations between validations"""

    def __post_init__(self) -> None:
        """Raises InputError for an invalid value."""
        check(self, ANALYTIC)


@dataclass(frozen=True)
class TrpoConfig:
    """Settings of a TRPO run. Batch, path, discount and network are the paper's; the others are ours."""

    seed: int = 0
    """first seed, of network, exploration and scenes; the others follow"""
    seeds: int = 1
    """policies trained side by side"""
    iterations: int = 500
    """batches"""
    environments: int = 25
    """paths in a batch: 25 x 800 steps are the paper's 20,000"""
    path: int = 800
    """steps of a path"""
    gamma: float = 0.9999
    """discount"""
    gae_lambda: float = 1.0
    """whole returns, RLLab's default: at 0.97 an action is charged for 3 s, and a lost gap costs longer"""
    target_kl: float = 0.01
    """trust region of the first batch; it falls along a line to nothing"""
    log_std: float = -0.7
    """of the exploration at the start, in actions of [-1, 1]"""
    scene: str = "paper"
    """training scenes"""
    memory: bool = False
    """the paper's policy has none"""
    printed_reward: bool = False
    """`Reward.paper()`: the plain squares that the paper prints, and alpha_crash 100; else `Reward`'s own"""
    validate_every: int = 10
    """iterations between validations and checkpoints"""
    curvature_share: float = 0.1
    """share of the states on which the curvature is estimated"""

    def __post_init__(self) -> None:
        """Raises InputError for an invalid value."""
        check(self, TRPO)


Config = AnalyticConfig | TrpoConfig


def settled(config: AnalyticConfig) -> AnalyticConfig:
    """The config with the default learning rate if it is 0."""
    rate = config.learning_rate or (FOLLOWER_RATE if config.memory else RANDOM_RATE)
    return replace(config, learning_rate=rate)


def check(config: Config, limits: Mapping[str, tuple[float, float]]) -> None:
    """Raises InputError for settings outside their (least, most) limits and an unknown scene, all in one
    line."""
    values = asdict(config)
    wrong = [
        _outside(name, values[name], *reach)
        for name, reach in limits.items()
        if not reach[0] <= values[name] <= reach[1]  # nor NaN
    ]
    if config.scene not in scenes.DRAWERS:
        wrong.append(f"there is no scene '{config.scene}'; known: {', '.join(scenes.DRAWERS)}")
    if wrong:
        raise InputError("; ".join(wrong))


def _outside(name: str, value: float, least: float, most: float) -> str:
    reach = f"at least {least:g}" if math.isinf(most) else f"{least:g} to {most:g}"
    return f"{name} is {value:g}; it must be {reach}"
