"""How the weights move: Muon for the matrices, AdamW for the rest."""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor

from deeptruck_model.deep.network import TruckNetwork

GATED = ("input", "recurrent")  # four matrices side by side
MATRICES = (*GATED, "decoder")  # the few columns of `output` are as good as vectors
MOMENTUM = 0.95
ITERATIONS, A, B, C = 5, 3.4445, -4.7750, 2.0315  # Newton-Schulz, as published
RMS = 0.2  # of a step; about that of Adam, so that both take one learning rate


class Muon(torch.optim.Optimizer):
    """Momentum made orthogonal (Jordan 2024): a step moves all directions of a matrix alike.

    torch.optim.Muon takes single matrices; here the members lie stacked in a parameter (members, rows,
    columns), each moving as if it were alone, and a gate is a matrix of its own.
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
            steps = [orthogonal(part) for part in ahead.chunk(gates, dim=-1)]
            p.add_(torch.cat(steps, dim=-1), alpha=-group["lr"])


def orthogonal(matrices: Tensor) -> Tensor:
    """Nearest to `matrices` (members, rows, columns) with singular values about 1, scaled to RMS an entry."""
    size = max(matrices.shape[1:])
    x = matrices / (matrices.flatten(1).norm(dim=1)[:, None, None] + 1e-12)
    tall = x.shape[1] > x.shape[2]
    x = x.mT if tall else x
    for _ in range(ITERATIONS):
        square = x @ x.mT
        x = A * x + (B * square + C * square @ square) @ x
    return (x.mT if tall else x) * (RMS * size**0.5)


def default_optimizers(network: TruckNetwork, lr: float, weight_decay: float) -> list[torch.optim.Optimizer]:
    """Muon and AdamW, which share out the parameters."""
    rest = [p for name, p in network.named_parameters() if name not in MATRICES]
    return [Muon(network, lr), torch.optim.AdamW(rest, lr=lr, weight_decay=weight_decay)]
