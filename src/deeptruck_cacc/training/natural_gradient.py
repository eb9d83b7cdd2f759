"""One trust-region step for a stack of Gaussian policies: natural gradient and line search, separately for
each seed.

The divergence is the mean over states and actions, as in sb3-contrib; textbooks sum over actions.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import torch
from torch import Tensor

from deeptruck_cacc.training.stacked import StackedMlp

CONJUGATE_STEPS, DAMPING = 15, 0.1  # sb3-contrib's
SHRINK, TRIES = 0.8, 10


@dataclass(frozen=True)
class Gaussian:
    """Policies of several seeds: mean (seeds, size) of `net`, and log_std (seeds, actions)."""

    net: StackedMlp
    mean: Tensor
    log_std: Tensor

    @property
    def flat(self) -> Tensor:
        """All parameters, (seeds, size + actions)."""
        return torch.cat([self.mean, self.log_std], dim=1)

    def at(self, flat: Tensor) -> Gaussian:
        """The same policies with other parameters."""
        return replace(self, mean=flat[:, : self.net.size], log_std=flat[:, self.net.size :])


def improve(
    policy: Gaussian, seen: Tensor, actions: Tensor, advantages: Tensor, some: Tensor, most_kl: float
) -> Gaussian:
    """The policies after one step of at most `most_kl`; a seed without an improving step is unchanged.

    seen (seeds, n, features), actions (seeds, n, 2), advantages (seeds, n); `some` (seeds, m) are the states
    at which the curvature is computed.
    """
    old, inputs = policy.net.forward(policy.mean, seen)
    sd = policy.log_std.exp()[:, None]
    off = (actions - old) / sd
    count = seen.shape[1]
    toward = policy.net.pull(policy.mean, inputs, advantages[..., None] * off / sd / count)
    spread = (advantages[..., None] * (off**2 - 1)).mean(dim=1)
    gradient = torch.cat([toward, spread], dim=1)
    curve = _curvature(policy, seen[torch.arange(len(some))[:, None], some])
    direction = _solve(curve, gradient)
    length = (2 * most_kl / (direction * curve(direction)).sum(dim=1).clamp(min=1e-12)).sqrt()
    step = length[:, None] * direction
    return _search(policy, step, (seen, actions, advantages, old), most_kl)


def _curvature(policy: Gaussian, seen: Tensor) -> Callable[[Tensor], Tensor]:
    """Damped Fisher matrix times a vector (seeds, size + actions)."""
    net, inputs = policy.net, policy.net.forward(policy.mean, seen)[1]
    actions = policy.log_std.shape[1]
    weight = (-2 * policy.log_std).exp()[:, None] / seen.shape[1] / actions

    def times(vector: Tensor) -> Tensor:
        pushed = net.push(policy.mean, inputs, vector[:, : net.size])
        back = net.pull(policy.mean, inputs, pushed * weight)
        return torch.cat([back, 2 / actions * vector[:, net.size :]], dim=1) + DAMPING * vector

    return times


def _solve(times: Callable[[Tensor], Tensor], target: Tensor) -> Tensor:
    """Conjugate gradients for all seeds at once."""
    x, left = torch.zeros_like(target), target.clone()
    way, size = left.clone(), (left**2).sum(dim=1, keepdim=True)
    for _ in range(CONJUGATE_STEPS):
        bent = times(way)
        pace = size / (way * bent).sum(dim=1, keepdim=True).clamp(min=1e-20)
        x, left = x + pace * way, left - pace * bent
        before, size = size, (left**2).sum(dim=1, keepdim=True)
        way = left + size / before.clamp(min=1e-20) * way
    return x


def _search(
    policy: Gaussian, step: Tensor, batch: tuple[Tensor, Tensor, Tensor, Tensor], most_kl: float
) -> Gaussian:
    """For each seed, the longest of ten step lengths that improves and stays within the trust region."""
    chosen, open_ = policy.flat, torch.ones(len(step), dtype=torch.bool)
    for k in range(TRIES):
        trial = policy.at(policy.flat + SHRINK**k * step)
        gain, kl = _judge(policy, trial, *batch)
        good = open_ & (gain > 0) & (kl < most_kl) & gain.isfinite()
        chosen = torch.where(good[:, None], trial.flat, chosen)
        open_ &= ~good
        if not open_.any():
            break
    return policy.at(chosen)


def _judge(
    old: Gaussian, new: Gaussian, seen: Tensor, actions: Tensor, advantages: Tensor, mean: Tensor
) -> tuple[Tensor, Tensor]:
    """Gain of the surrogate and Kullback-Leibler divergence from the old policy, each (seeds,)."""
    moved = new.net.forward(new.mean, seen)[0]
    sd, new_sd = old.log_std.exp()[:, None], new.log_std.exp()[:, None]
    wider = (new.log_std - old.log_std)[:, None]
    log_ratio = (((actions - mean) / sd) ** 2 - ((actions - moved) / new_sd) ** 2) / 2 - wider
    ratio = log_ratio.sum(dim=2).exp()
    kl = wider + (sd**2 + (moved - mean) ** 2) / (2 * new_sd**2) - 0.5
    return (ratio * advantages).mean(dim=1) - advantages.mean(dim=1), kl.mean(dim=(1, 2))
