"""Which weights of a training run are kept: each member's best in free runs on held-out data."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from torch import Tensor

from deeptruck_model.deep.data.scales import FloatArray
from deeptruck_model.deep.data.windows import Sequences
from deeptruck_model.deep.kernels import loss
from deeptruck_model.deep.network import WEIGHTS, TruckNetwork

VALIDATION_RUNS = 64


class Best:
    """The weights of every member at its lowest validation loss."""

    def __init__(self, network: TruckNetwork) -> None:
        self.scores = np.full(network.shape.members, np.inf)
        self.weights: dict[str, Tensor] = {n: getattr(network, n).detach().clone() for n in WEIGHTS}

    def keep(self, scores: np.ndarray[Any, Any], network: TruckNetwork) -> None:
        """Take over the members that improved. Weights may overflow where the responses, squeezed by tanh,
        do not: such a member has diverged, whatever its score."""
        for m in np.flatnonzero((scores < self.scores) & finite(network)):
            self.scores[m] = scores[m]
            for name in WEIGHTS:
                self.weights[name][m] = getattr(network, name).detach()[m]

    def restore(self, network: TruckNetwork) -> None:
        """Put the kept weights back."""
        for name in WEIGHTS:
            getattr(network, name).data.copy_(self.weights[name])


def finite(network: TruckNetwork) -> np.ndarray[Any, Any]:
    """True for members, (members,), all of whose weights are numbers."""
    weights = [getattr(network, name).detach().flatten(1) for name in WEIGHTS]
    return np.asarray(torch.isfinite(torch.cat(weights, dim=1)).all(dim=1).numpy())


def validate(
    network: TruckNetwork, held_out: Sequences, weight: FloatArray, steps: int
) -> np.ndarray[Any, Any]:
    """Loss of free runs of `steps` from evenly spaced starts in the held-out data, (members,); inf where
    not finite."""
    steps = min(steps, int(np.max(held_out.bounds[:, 1] - held_out.bounds[:, 0])) - 1)
    candidates = np.sort(held_out.starts(steps, np.random.default_rng(0)))
    if len(candidates) < VALIDATION_RUNS:
        candidates = np.sort(held_out.draw(VALIDATION_RUNS, steps, np.random.default_rng(0)))
    starts = candidates[np.linspace(0, len(candidates) - 1, VALIDATION_RUNS).astype(int)]
    x, target = held_out.gather(np.repeat(starts[None], network.shape.members, axis=0), steps)
    losses = loss.loss(network, x, target, weight)
    return np.where(np.isfinite(losses), losses, np.inf)
