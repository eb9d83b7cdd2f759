"""Policies in torch: several seeds of the paper's MLP at once, with the same maps as the numpy policy."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from deeptruck_cacc.policy import MlpPolicy
from deeptruck_cacc.scaling import ActionScale, FeatureMap
from deeptruck_model.signals import TruckInterface


class _ClipInward(torch.autograd.Function):
    """Clip whose gradient still leads back from beyond a limit, so a released brake can be found again."""

    @staticmethod
    def forward(ctx: Any, x: Tensor, low: float, high: float) -> Tensor:
        ctx.save_for_backward(x)
        ctx.limits = low, high
        return x.clamp(low, high)

    @staticmethod
    def backward(ctx: Any, *gradients: Tensor) -> tuple[Tensor, None, None]:
        (x,), (low, high), gradient = ctx.saved_tensors, ctx.limits, gradients[0]
        outward = ((x > high) & (gradient < 0)) | ((x < low) & (gradient > 0))
        return torch.where(outward, torch.zeros_like(gradient), gradient), None, None


class SeedBatch(torch.nn.Module):
    """`seeds` independent MLPs behind one feature map; rows of every input are grouped by seed."""

    def __init__(
        self,
        seeds: list[int],
        features: FeatureMap,
        scale: ActionScale,
        hidden: tuple[int, ...] = (25, 25, 25),
    ) -> None:
        super().__init__()
        self.features, self.scale, self.count = features, scale, len(seeds)
        sizes = [len(features.names), *hidden, 2]
        generators = [torch.Generator().manual_seed(seed) for seed in seeds]
        self.weights = torch.nn.ParameterList()
        self.biases = torch.nn.ParameterList()
        for k, (fan_in, fan_out) in enumerate(pairwise(sizes)):
            gain = (0.1 if k == len(hidden) else 1.0) / fan_in**0.5
            stack = [gain * torch.randn(fan_out, fan_in, generator=g) for g in generators]
            self.weights.append(torch.nn.Parameter(torch.stack(stack)))
            self.biases.append(torch.nn.Parameter(torch.zeros(len(seeds), 1, fan_out)))
        with torch.no_grad():
            self.biases[-1][:, :, 0] = -0.5  # a quarter of the engine: about what holds a truck's speed
            self.biases[-1][:, :, 1] = -0.2  # brake released: one that starts dragging is slow to let go
        self.matrix = torch.tensor(features.matrix, dtype=torch.float32)
        self.offset = torch.tensor(features.offset, dtype=torch.float32)

    def start(self, rows: int) -> Tensor:
        """Memory before the first observation, (rows, memory)."""
        return torch.tensor(self.features.start(rows), dtype=torch.float32)

    def forward(self, signals: Tensor, memory: Tensor) -> tuple[Tensor, Tensor]:
        """Actions in [-1, 1] (rows, 2) and the next memory, from signals (rows, 5)."""
        features, memory = self.observe(signals, memory)
        hidden = features.view(self.count, -1, features.shape[1])
        last = len(self.weights) - 1
        for k, (weight, bias) in enumerate(zip(self.weights, self.biases, strict=True)):
            hidden = torch.baddbmm(bias, hidden, weight.transpose(1, 2))
            hidden = hidden if k == last else torch.tanh(hidden)
        mean = hidden.reshape(-1, 2)
        return _ClipInward.apply(mean, -1.0, 1.0), memory  # type: ignore[no-untyped-call]

    def observe(self, signals: Tensor, memory: Tensor) -> tuple[Tensor, Tensor]:
        """FeatureMap in torch."""
        f = self.features
        features = signals @ self.matrix.T + self.offset
        if not f.memory:
            return features, memory
        speeds = signals[:, :2]
        slow = torch.where(memory[:, 1:].isnan(), speeds, memory[:, 1:])
        error = (signals[:, 2] - signals[:, 3]).clamp(-f.integral_clip_m, f.integral_clip_m)
        integral = (memory[:, 0] + f.dt * error).clamp(-f.integral_limit, f.integral_limit)
        rates = (speeds - slow) / f.slow_s
        memory = torch.cat([integral[:, None], slow + f.dt * rates], dim=1)
        return torch.cat([features, integral[:, None] / 5.0, rates / 0.5], dim=1), memory

    def commands(self, action: Tensor) -> Tensor:
        """ActionScale in torch, for actions within [-1, 1]; the brake's dead half leads its gradient back."""
        s = self.scale
        engine = s.engine_low + (action[:, 0] + 1) / 2 * (s.engine_high - s.engine_low)
        brake: Tensor = _ClipInward.apply(action[:, 1], 0.0, 1.0)  # type: ignore[no-untyped-call]
        return torch.stack([engine, brake * s.brake_high], dim=1)

    def policy(
        self,
        seed: int,
        interface: TruckInterface,
        coverage: dict[str, tuple[float, float]],
        card: dict[str, Any],
    ) -> MlpPolicy:
        """One seed as the numpy policy."""

        def array(x: Tensor) -> NDArray[np.float64]:
            return x.detach().numpy().astype(float)

        pairs = zip(self.weights, self.biases, strict=True)
        layers = [(array(weight[seed]), array(bias[seed, 0])) for weight, bias in pairs]
        return MlpPolicy(layers, self.features, self.scale, interface, coverage, card)
