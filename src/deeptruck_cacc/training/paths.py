"""Batches of paths for many seeds at once, and advantages of their actions."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields
from typing import Any, NamedTuple

import numpy as np
import torch
from torch import Tensor

from deeptruck_cacc.controllers.scaling import FeatureMap, paper_signals
from deeptruck_cacc.environments.environment import CaccEnv
from deeptruck_cacc.environments.scenes import Scene

REACH = 50.0  # features are clipped here, as in faces.py


class Paths(NamedTuple):
    """Observed features `seen` (seeds, environments, path + 1, features), actions (seeds, environments, path,
    2) and rewards (seeds, environments, path)."""

    seen: Tensor
    actions: Tensor
    rewards: Tensor


def drive(
    env: CaccEnv, scenes: list[Scene], features: FeatureMap, act: Callable[[int, Tensor], Tensor]
) -> Paths:
    """One path through every row of every seed's scene; act(k, seen (seeds, rows, features)) gives the
    actions (seeds, rows, 2) of step k."""
    observation, memory = env.reset(side_by_side(scenes)), features.start(env.batch)
    seen: list[Tensor] = []
    actions: list[Tensor] = []
    rewards: list[Tensor] = []
    while True:
        x, memory = features(paper_signals(observation), memory)
        seen.append(torch.from_numpy(np.clip(x, -REACH, REACH)).float().view(len(scenes), -1, x.shape[1]))
        if env.done:
            return Paths(*(torch.stack(steps, dim=2) for steps in (seen, actions, rewards)))
        action = act(env.k, seen[-1])
        observation, paid, _ = env.step(env.scale.commands(action.flatten(0, 1).double().numpy()))
        actions.append(action)
        rewards.append(torch.from_numpy(paid).float().view(len(scenes), -1))


def draw(rngs: list[np.random.Generator], count: int, share: float) -> Tensor:
    """`count` states of every seed in random order, (seeds, n)."""
    some = [rng.choice(count, max(1, round(share * count)), replace=False) for rng in rngs]
    return torch.from_numpy(np.stack(some))


def advantage(rewards: Tensor, values: Tensor, gamma: float, gae_lambda: float) -> Tensor:
    """Generalised advantage (..., T) of rewards (..., T) and values (..., T + 1) of paths that are truncated
    and not terminated."""
    errors = rewards + gamma * values[..., 1:] - values[..., :-1]
    out = torch.empty_like(errors)
    after = torch.zeros_like(errors[..., 0])
    for k in range(errors.shape[-1] - 1, -1, -1):
        after = errors[..., k] + gamma * gae_lambda * after
        out[..., k] = after
    return out


def side_by_side(parts: list[Scene]) -> Scene:
    """Concatenate scenes of equal length along the batch. A field must be set in all or in none."""
    columns: dict[str, Any] = {}
    for name in (f.name for f in fields(Scene)):
        rows = [getattr(part, name) for part in parts]
        columns[name] = None if rows[0] is None else np.concatenate(rows)
    return Scene(**columns)
