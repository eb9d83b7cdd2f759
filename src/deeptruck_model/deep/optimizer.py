"""Optimisers, learning rate, gradient clipping, and selection of the best weights.

Paper mode: Adagrad. Default mode: Muon for the matrices, AdamW for the rest.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import torch
from torch import Tensor

from deeptruck_model.deep.arguments import Arguments
from deeptruck_model.deep.data import FloatArray, Sequences
from deeptruck_model.deep.kernels import loss
from deeptruck_model.deep.network import WEIGHTS, TruckNetwork

GATED = ("input", "recurrent")  # four matrices side by side
MATRICES = (*GATED, "decoder")  # the few columns of `output` are as good as vectors
MOMENTUM = 0.95
ITERATIONS, A, B, C = 5, 3.4445, -4.7750, 2.0315  # Newton-Schulz, as published
PAPER_RATE, RATE, ADAPTING_RATE = 0.02, 6e-3, 2e-3
CLIP = 1.0
RMS = 0.2  # of a step; about that of Adam, so that both take one learning rate
VALIDATION_RUNS = 64


class Muon(torch.optim.Optimizer):
    """Orthogonalised momentum (Jordan 2024): a step changes all directions of a matrix equally.

    torch.optim.Muon takes single matrices; here the members are stacked in a parameter (members, rows,
    columns) and updated independently, each gate as a separate matrix.
    """

    def __init__(self, network: TruckNetwork, lr: float) -> None:
        super().__init__([getattr(network, name) for name in MATRICES], {"lr": lr})
        self._gates = [4 if name in GATED else 1 for name in MATRICES]

    @torch.no_grad()
    def step(self, closure: Any = None) -> Any:
        """One step of every matrix that has a gradient."""
        (group,) = self.param_groups
        for p, gates in zip(group["params"], self._gates, strict=True):
            state = self.state[p]
            momentum = state.setdefault("momentum", torch.zeros_like(p))
            momentum.mul_(MOMENTUM).add_(p.grad)
            ahead = torch.add(p.grad, momentum, alpha=MOMENTUM)
            alone = torch.unflatten(ahead, -1, (gates, -1)).movedim(-2, 1).flatten(0, 1)
            steps = torch.unflatten(orthogonal(alone), 0, (-1, gates)).movedim(1, -2).flatten(-2)
            p.add_(steps, alpha=-group["lr"])


def orthogonal(matrices: Tensor) -> Tensor:
    """The matrices nearest to `matrices` (members, rows, columns) with singular values of about 1, scaled to
    a fixed RMS per entry."""
    size = max(matrices.shape[1:])
    x = matrices / (matrices.flatten(1).norm(dim=1)[:, None, None] + 1e-12)
    tall = x.shape[1] > x.shape[2]
    x = x.mT if tall else x
    for _ in range(ITERATIONS):
        square = x @ x.mT
        x = A * x + (B * square + C * square @ square) @ x
    return (x.mT if tall else x) * (RMS * size**0.5)


def default_optimizers(network: TruckNetwork, lr: float, weight_decay: float) -> list[torch.optim.Optimizer]:
    """Muon and AdamW, each for its share of the parameters."""
    rest = [p for name, p in network.named_parameters() if name not in MATRICES]
    return [Muon(network, lr), torch.optim.AdamW(rest, lr=lr, weight_decay=weight_decay)]


def optimizers(network: TruckNetwork, arguments: Arguments) -> list[torch.optim.Optimizer]:
    """The optimizers of the mode in the arguments; each parameter belongs to one of them."""
    rate = learning_rate(arguments, 0, 1)
    if arguments.mode == "paper":
        return [torch.optim.Adagrad(network.parameters(), lr=rate)]
    return default_optimizers(network, rate, arguments.weight_decay)


def peak_rate(arguments: Arguments) -> float:
    """The highest learning rate of a run: the given one, or the default of the mode."""
    own = PAPER_RATE if arguments.mode == "paper" else ADAPTING_RATE if arguments.start else RATE
    return arguments.learning_rate or own


def largest_gradient(arguments: Arguments) -> float:
    """The norm to which a member's gradient is clipped; the paper does not mention clipping."""
    return arguments.clip or (math.inf if arguments.mode == "paper" else CLIP)


def learning_rate(arguments: Arguments, done: int, updates: int) -> float:
    """Paper: constant. Default: 200 steps of warm-up, then half a cosine down to a hundredth."""
    peak, warm = peak_rate(arguments), min(200, updates // 10)
    if arguments.mode == "paper":
        return peak
    if done < warm:
        return peak * (done + 1) / warm
    phase = (done - warm) / max(1, updates - warm)
    return peak * (0.01 + 0.99 * 0.5 * (1 + math.cos(math.pi * phase)))


def guard(network: TruckNetwork, losses: np.ndarray[Any, Any], limit: float) -> None:
    """Clip each member's gradient to `limit`; a gradient that is not finite is set to zero."""
    gradients = [p.grad for p in network.parameters() if p.grad is not None]
    norm = torch.stack([g.flatten(1).square().sum(1) for g in gradients]).sum(0).sqrt()
    finite = torch.isfinite(norm) & torch.as_tensor(np.isfinite(losses))
    factor = torch.where(finite, (limit / norm).clamp(max=1.0), torch.zeros(()))
    for g in gradients:
        shaped = factor.reshape(-1, *([1] * (g.dim() - 1)))
        g.copy_(torch.where(finite.reshape(shaped.shape), g * shaped, torch.zeros(())))


class Best:
    """The weights of every member at its lowest validation loss."""

    def __init__(self, network: TruckNetwork) -> None:
        self.scores = np.full(network.shape.members, np.inf)
        self.weights: dict[str, Tensor] = {n: getattr(network, n).detach().clone() for n in WEIGHTS}

    def keep(self, scores: np.ndarray[Any, Any], network: TruckNetwork) -> None:
        """Store the weights of members that improved. A member whose weights are not finite has diverged,
        whatever its score, since tanh keeps the responses finite."""
        for m in np.flatnonzero((scores < self.scores) & finite(network)):
            self.scores[m] = scores[m]
            for name in WEIGHTS:
                self.weights[name][m] = getattr(network, name).detach()[m]

    def restore(self, network: TruckNetwork) -> None:
        """Put the kept weights back."""
        for name in WEIGHTS:
            getattr(network, name).data.copy_(self.weights[name])


def finite(network: TruckNetwork) -> np.ndarray[Any, Any]:
    """Whether all weights of each member are finite, (members,)."""
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
