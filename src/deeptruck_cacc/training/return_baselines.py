"""Baselines of TRPO: the expected return from each state of a path, with which an action is compared.

`linear` is a least-squares fit to returns of any size, as in RLLab, with which the paper trained. RLLab fits
it to the previous batch (`linear-before`); after a crash in that batch its error is many times what it
explains, so ours is fitted to the current batch: a dozen weights to 20,000 steps. `network` is that of
sb3-contrib, whose fixed step size is too slow for returns of several thousand.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
import torch
from torch import Tensor

from deeptruck_cacc.training import paths, progress
from deeptruck_cacc.training.settings import TrpoConfig
from deeptruck_cacc.training.stacked import StackedMlp

HIDDEN = (25, 25, 25)
FEATURE_REACH, TIME_STEPS, RIDGE = 10.0, 100.0, 1e-5  # RLLab's


class Baseline(Protocol):
    """Value function for the states of every seed."""

    def values(self, seen: Tensor, rewards: Tensor) -> Tensor:
        """Expected returns (seeds, environments, T + 1) from observed features (.., T + 1, features) and
        rewards (.., T)."""

    def learn(self, seen: Tensor, targets: Tensor, rngs: list[np.random.Generator]) -> None:
        """Fit to the TD(lambda) targets, (seeds, environments, T), after the policy was updated."""

    def tensors(self) -> dict[str, Tensor]:
        """The state that a resumed run needs."""

    def restore(self, tensors: dict[str, Tensor]) -> None:
        """Inverse of `tensors`."""


def baseline(config: TrpoConfig, width: int, generators: list[torch.Generator]) -> Baseline:
    """The baseline selected by the settings, for states of `width` features."""
    if config.baseline == "network":
        return Network(config, width, generators)
    weights = torch.zeros(len(generators), 2 * width + 4, 1, dtype=torch.float64)
    return Linear(config.gamma, weights, before=config.baseline == "linear-before")


class Linear:
    """Linear in the features, their squares and time to the third power, fitted to discounted returns.

    Time is a feature because a path ends at its last step, so that less return remains later.
    """

    def __init__(self, gamma: float, weights: Tensor, *, before: bool) -> None:
        self.gamma, self.weights, self.before = gamma, weights, before

    def values(self, seen: Tensor, rewards: Tensor) -> Tensor:
        """Expected returns; zero at the end of a path."""
        terms = _terms(seen)
        fitted = self._fitted(terms[:, :, :-1].flatten(1, 2), rewards)
        weights, self.weights = self.weights if self.before else fitted, fitted
        values = (terms.flatten(1, 2) @ weights).view(seen.shape[:3]).float()
        values[..., -1] = 0.0
        return values

    def _fitted(self, terms: Tensor, rewards: Tensor) -> Tensor:
        nothing = torch.nn.functional.pad(torch.zeros_like(rewards), (0, 1))
        returns = paths.advantage(rewards, nothing, self.gamma, 1.0).flatten(1)[..., None].double()
        square = terms.transpose(1, 2) @ terms + RIDGE * torch.eye(terms.shape[2], dtype=torch.float64)
        return torch.linalg.solve(square, terms.transpose(1, 2) @ returns)

    def learn(self, seen: Tensor, targets: Tensor, rngs: list[np.random.Generator]) -> None:
        """Does nothing; `values` fits the returns."""

    def tensors(self) -> dict[str, Tensor]:
        """The weights."""
        return {"value": self.weights}

    def restore(self, tensors: dict[str, Tensor]) -> None:
        """Inverse of `tensors`."""
        self.weights = tensors["value"]


class Network:
    """A network of the policy's shape, trained by Adam on the squared error over shuffled minibatches."""

    def __init__(self, config: TrpoConfig, width: int, generators: list[torch.Generator]) -> None:
        self.config, self.net = config, StackedMlp((width, *HIDDEN, 1))
        self.parameters = self.net.fresh(generators, 1.0)
        self.adam = torch.optim.Adam([self.parameters], lr=config.value_rate)

    def values(self, seen: Tensor, rewards: Tensor) -> Tensor:
        """Output of the network, also at the end of a path."""
        return self.net.forward(self.parameters, seen.flatten(1, 2))[0].view(seen.shape[:3])

    def learn(self, seen: Tensor, targets: Tensor, rngs: list[np.random.Generator]) -> None:
        """A few epochs over a random share of the states, redrawn each time."""
        c, rows = self.config, torch.arange(len(seen))[:, None]
        states, wanted = seen[:, :, :-1].flatten(1, 2), targets.flatten(1)
        for _ in range(c.value_passes):
            some = paths.draw(rngs, states.shape[1], c.value_share)
            for piece in torch.split(some, c.value_batch, dim=1):
                value, inputs = self.net.forward(self.parameters, states[rows, piece])
                error = value - wanted[rows, piece][..., None]
                self.parameters.grad = self.net.pull(self.parameters, inputs, 2 * error / piece.shape[1])
                self.adam.step()

    def tensors(self) -> dict[str, Tensor]:
        """Parameters and the optimiser's state."""
        return {"value": self.parameters} | progress.adam_tensors(self.adam)

    def restore(self, tensors: dict[str, Tensor]) -> None:
        """Inverse of `tensors`."""
        self.parameters.copy_(tensors["value"])
        progress.restore_adam(self.adam, tensors)


def _terms(seen: Tensor) -> Tensor:
    """Regressors of the linear baseline, (seeds, environments, steps, 2 features + 4)."""
    x = seen.double().clamp(-FEATURE_REACH, FEATURE_REACH)
    time = (torch.arange(x.shape[2], dtype=torch.float64) / TIME_STEPS)[:, None].expand(*x.shape[:3], 1)
    return torch.cat([x, x**2, time, time**2, time**3, torch.ones_like(time)], dim=3)
