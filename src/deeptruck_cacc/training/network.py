"""Policies in torch: the paper's MLP for several seeds at once, with the same maps as the numpy policy."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from deeptruck_cacc.controllers.pedals import PedalMap
from deeptruck_cacc.controllers.policy import MlpPolicy
from deeptruck_cacc.controllers.scaling import ActionScale, FeatureMap
from deeptruck_core.signals import TruckInterface

# Scales at which a follower starts through the tanh of three layers; the brake's is small, so that it brakes
# in proportion.
PULL_SCALE, BRAKE_SCALE = 0.3, 0.1


class _ClipInward(torch.autograd.Function):
    """Clip with a gradient that beyond a limit still points back inside, so that training can apply a
    released brake again."""

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
        matrix, offset = (torch.tensor(x, dtype=torch.float32) for x in (features.matrix, features.offset))
        self.observe = replace(features, matrix=matrix, offset=offset)

    @classmethod
    def of(cls, policy: MlpPolicy) -> SeedBatch:
        """A trained policy as a batch of one seed, without gradients."""
        hidden = tuple(len(bias) for _, bias in policy.layers[:-1])
        batch = cls([0], policy.features, policy.scale, hidden).requires_grad_(False)
        for k, (weight, bias) in enumerate(policy.layers):
            batch.weights[k].copy_(torch.from_numpy(weight))
            batch.biases[k].copy_(torch.from_numpy(bias))
        return batch

    @torch.no_grad()
    def start_as_follower(self, pedals: PedalMap) -> None:
        """Initialise the policies as a simple following law, so that no seed must find following by chance.

        The first unit of each layer carries the required power to the engine, the second the required
        acceleration to the brake, both as in the pedal map between 8 and 24 m/s.
        """
        if not self.features.power:
            return
        usual = (pedals.speed >= 8.0) & (pedals.speed <= 24.0)
        speed, coast = pedals.speed[usual], pedals.coast[usual]
        power = float(((pedals.full[usual] - coast) * speed).mean())
        braking = float((coast - pedals.brake[usual]).mean())
        starts = (("wanted_power", PULL_SCALE), ("wanted_acceleration", BRAKE_SCALE))
        for unit, (name, scale) in enumerate(starts):
            for k, weight in enumerate(self.weights[:-1]):
                weight[:, unit] = 0.0
                weight[:, unit, unit if k else self.features.names.index(name)] = 1.0 if k else scale
        self.weights[-1][:, 0, 0] = 2 * 8.0 / power / PULL_SCALE
        self.weights[-1][:, 1, 1] = -0.5 / braking / BRAKE_SCALE
        self.biases[-1][:, :, 0] = 2 * float((-coast * speed).mean()) / power - 1.0
        self.biases[-1][:, :, 1] = float(coast.mean()) / braking

    def start(self, rows: int) -> Tensor:
        """Initial memory, (rows, memory)."""
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
        action: Tensor = _ClipInward.apply(mean, -1.0, 1.0)  # type: ignore[no-untyped-call]
        return action, self.observe.remember(memory, action)

    def asked(self, action: Tensor) -> tuple[Tensor, Tensor]:
        """Engine and brake shares of their ranges that an action requests; in the brake's inactive half the
        gradient points back to the active one."""
        brake: Tensor = _ClipInward.apply(action[:, 1], 0.0, 1.0)  # type: ignore[no-untyped-call]
        return (action[:, 0] + 1) / 2, brake

    def commands(self, action: Tensor) -> Tensor:
        """ActionScale in torch, for actions within [-1, 1]."""
        s, (engine, brake) = self.scale, self.asked(action)
        if s.exclusive:
            engine, brake = (engine - brake).clamp(min=0.0), (brake - engine).clamp(min=0.0)
        reach = s.engine_high - s.engine_low
        return torch.stack([s.engine_low + engine * reach, brake * s.brake_high], dim=1)

    def policy(
        self, seed: int, interface: TruckInterface, coverage: dict[str, tuple[float, float]]
    ) -> MlpPolicy:
        """One seed as the numpy policy."""

        def array(x: Tensor) -> NDArray[np.float64]:
            return x.detach().numpy().astype(float)

        pairs = zip(self.weights, self.biases, strict=True)
        layers = [(array(weight[seed]), array(bias[seed, 0])) for weight, bias in pairs]
        return MlpPolicy(layers, self.features, self.scale, interface, coverage)
