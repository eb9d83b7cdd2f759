"""MLPs of several seeds as one stack, with explicit derivatives, on flat parameter vectors.

A natural gradient needs the same products with the Jacobian many times; explicit derivatives cost two matrix
products per layer and need no graph.
"""

from __future__ import annotations

from itertools import pairwise

import torch
from torch import Tensor


class StackedMlp:
    """The shape of several MLPs with tanh between layers: parameters (seeds, size), inputs (seeds, n, in)."""

    def __init__(self, sizes: tuple[int, ...]) -> None:
        self.sizes = sizes
        self.size = sum(a * b + b for a, b in pairwise(sizes))

    def fresh(self, generators: list[torch.Generator], last_gain: float) -> Tensor:
        """Orthogonal weights of gain sqrt(2) (`last_gain` in the last layer), biases zero, (seeds, size)."""
        rows = []
        for generator in generators:
            parts: list[Tensor] = []
            for k, (a, b) in enumerate(pairwise(self.sizes)):
                gain = last_gain if k == len(self.sizes) - 2 else 2**0.5
                weight = torch.nn.init.orthogonal_(torch.empty(b, a), gain, generator)
                parts += [weight.T.reshape(-1), torch.zeros(b)]
            rows.append(torch.cat(parts))
        return torch.stack(rows)

    def layers(self, parameters: Tensor) -> list[tuple[Tensor, Tensor]]:
        """Views (weight (seeds, in, out), bias (seeds, 1, out)) of parameters (seeds, size)."""
        out, at = [], 0
        for a, b in pairwise(self.sizes):
            weight = parameters[:, at : at + a * b].view(-1, a, b)
            bias = parameters[:, at + a * b : at + a * b + b].view(-1, 1, b)
            out.append((weight, bias))
            at += a * b + b
        return out

    def forward(self, parameters: Tensor, x: Tensor) -> tuple[Tensor, list[Tensor]]:
        """Outputs (seeds, n, out), and the inputs of every layer, which the derivatives need."""
        inputs, layers = [], self.layers(parameters)
        for k, (weight, bias) in enumerate(layers):
            inputs.append(x)
            x = torch.baddbmm(bias, x, weight)
            x = x if k == len(layers) - 1 else torch.tanh_(x)
        return x, inputs

    def push(self, parameters: Tensor, inputs: list[Tensor], change: Tensor) -> Tensor:
        """Jacobian-vector product: change of the outputs for the parameter change `change` (seeds, size)."""
        moved: Tensor | None = None
        pairs = list(zip(self.layers(parameters), self.layers(change), strict=True))
        for k, ((weight, _), (d_weight, d_bias)) in enumerate(pairs):
            here = torch.baddbmm(d_bias, inputs[k], d_weight)
            moved = here if moved is None else here.baddbmm_(moved, weight)
            if k < len(pairs) - 1:
                moved = moved * (1 - inputs[k + 1] ** 2)
        assert moved is not None
        return moved

    def pull(self, parameters: Tensor, inputs: list[Tensor], back: Tensor) -> Tensor:
        """Vector-Jacobian product: parameter gradient (seeds, size) for the output gradient `back` (seeds, n,
        out)."""
        parts: list[Tensor] = []
        layers = self.layers(parameters)
        for k in range(len(layers) - 1, -1, -1):
            weight, x = layers[k][0], inputs[k]
            bias = back.sum(dim=1)
            parts = [torch.bmm(x.transpose(1, 2), back).flatten(1), bias, *parts]
            if k:
                back = torch.bmm(back, weight.transpose(1, 2)) * (1 - x**2)
        return torch.cat(parts, dim=1)
