"""TRPO in the paper's setting, for any number of seeds: all trucks in one batch, all networks in one stack.

Batches of 20,000 steps, paths of 800, gamma 0.9999, a Gaussian over an MLP of 3 x 25. Whole returns are
compared with a linear baseline of the expected return, a least-squares fit as in RLLab, with which the paper
trained; RLLab fits it to the previous batch, which after a crash misleads it, ours is fitted to the current
one: a dozen weights to 20,000 steps. The curvature is computed on a random share of the states, as in the
TRPO paper, because states a tenth of a second apart are similar. The trust region decreases linearly to zero,
so that the final policy is kept. A seed's result does not depend on the other seeds.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack, closing
from dataclasses import dataclass, fields, replace
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import torch
from torch import Tensor

from deeptruck_cacc.controllers.policy import MlpPolicy
from deeptruck_cacc.controllers.scaling import FeatureMap, paper_signals
from deeptruck_cacc.environments import scenes
from deeptruck_cacc.environments.environment import CaccEnv
from deeptruck_cacc.environments.reward import Reward
from deeptruck_cacc.environments.scenes import Scene
from deeptruck_cacc.training import validation
from deeptruck_cacc.training.saving import Log, save
from deeptruck_cacc.training.settings import TrpoConfig
from deeptruck_model.simulators import Simulator

HIDDEN = (25, 25, 25)
REACH = 50.0  # features are clipped here, as in adapters.py
FEATURE_REACH, TIME_STEPS, RIDGE = 10.0, 100.0, 1e-5  # RLLab's
CONJUGATE_STEPS, DAMPING = 15, 0.1  # sb3-contrib's
SHRINK, TRIES = 0.8, 10


def train(
    simulator: Simulator,
    out: Path,
    config: TrpoConfig,
    *,
    reward: Reward,
    source: str,
    progress: Callable[[int, int, str], None],
) -> None:
    """Train every seed, and keep each at its best validation in `out`; see `training.train`.

    `Reward.paper()` replaces `reward` if the config selects the printed one. Each iteration begins with fresh
    paths and its own random numbers.
    """
    c = config
    reward = Reward.paper() if c.printed_reward else reward

    seeds = [c.seed + k for k in range(c.seeds)]
    env = CaccEnv(simulator, c.seeds * c.environments, c.path, reward=reward)
    features = FeatureMap.default(memory=c.memory, dt=simulator.dt)
    net = StackedMlp((len(features.names), *HIDDEN, 2))
    mean = net.fresh([torch.Generator().manual_seed(seed) for seed in seeds], 0.01)
    policy = Gaussian(net, mean, torch.full((c.seeds, 2), c.log_std))
    exam = validation.exam(c.seed, simulator.dt, late=c.scene == "late")
    best, best_scores = mean.clone(), [float("inf")] * c.seeds
    draw = scenes.DRAWERS[c.scene]
    coverage = scenes.reach(draw(np.random.default_rng(0), 2000, c.path, env.dt))

    def as_policy(k: int, parameters: Tensor) -> MlpPolicy:
        layers = [
            (weight[k].T.double().numpy(), bias[k, 0].double().numpy())
            for weight, bias in net.layers(parameters)
        ]
        return MlpPolicy(layers, features, env.scale, simulator.interface, coverage)

    with ExitStack() as opened:
        logs = [opened.enter_context(closing(Log(out / "seeds" / str(seed)))) for seed in seeds]
        for i in range(c.iterations):
            rngs = [np.random.default_rng([seed, i]) for seed in seeds]
            scene = [draw(rng, c.environments, c.path, env.dt) for rng in rngs]
            noise = np.stack([rng.standard_normal((c.path, c.environments, 2)) for rng in rngs], axis=1)
            seen, actions, rewards = drive(env, scene, features, policy, torch.from_numpy(noise).float())
            values = expected_returns(seen, rewards, c.gamma)
            gain = advantage(rewards, values, c.gamma, c.gae_lambda).flatten(1)
            gain = (gain - gain.mean(dim=1, keepdim=True)) / (gain.std(dim=1, keepdim=True) + 1e-8)
            states = seen[:, :, :-1].flatten(1, 2)
            count = states.shape[1]
            few = max(1, round(c.curvature_share * count))
            some = torch.from_numpy(np.stack([rng.choice(count, few, replace=False) for rng in rngs]))
            most_kl = c.target_kl * (1 - i / c.iterations)
            policy = improve(policy, states, actions.flatten(1, 2), gain, some, most_kl)

            returns = rewards.sum(dim=2).double().numpy()
            rows: list[dict[str, Any]] = [
                {"return_mean": float(r.mean()), "return_min": float(r.min()), "return_max": float(r.max())}
                for r in returns
            ]
            if (i + 1) % c.validate_every == 0 or i + 1 == c.iterations:
                for k, row in enumerate(rows):
                    row["validation"] = validation.score(simulator, as_policy(k, policy.mean), exam)
                    if row["validation"] < best_scores[k]:
                        best_scores[k], best[k] = row["validation"], policy.mean[k]
            for log, row in zip(logs, rows, strict=True):
                log.write(i, row)
            progress(i + 1, c.iterations, f"return {returns.mean():.1f} best {min(best_scores):.3f}")

    save(out, [as_policy(k, best) for k in range(c.seeds)], best_scores, config, reward, source)


class Paths(NamedTuple):
    """Observed features `seen` (seeds, environments, path + 1, features), actions (seeds, environments, path,
    2) and rewards (seeds, environments, path)."""

    seen: Tensor
    actions: Tensor
    rewards: Tensor


def drive(env: CaccEnv, scenes: list[Scene], features: FeatureMap, policy: Gaussian, noise: Tensor) -> Paths:
    """One path through every row of every seed's scene; standard normal noise (path, seeds, rows, 2)."""
    spread = policy.log_std.exp()[:, None] * noise
    observation, memory = env.reset(side_by_side(scenes)), features.start(env.batch)
    seen: list[Tensor] = []
    actions: list[Tensor] = []
    rewards: list[Tensor] = []
    while True:
        x, memory = features(paper_signals(observation), memory)
        seen.append(torch.from_numpy(np.clip(x, -REACH, REACH)).float().view(len(scenes), -1, x.shape[1]))
        if env.done:
            return Paths(*(torch.stack(steps, dim=2) for steps in (seen, actions, rewards)))
        action = policy.net.forward(policy.mean, seen[-1])[0] + spread[env.k]
        observation, paid, _ = env.step(env.scale.commands(action.flatten(0, 1).double().numpy()))
        actions.append(action)
        rewards.append(torch.from_numpy(paid).float().view(len(scenes), -1))


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


def expected_returns(seen: Tensor, rewards: Tensor, gamma: float) -> Tensor:
    """Expected returns (seeds, environments, T + 1), zero at the end of a path, from observed features
    (.., T + 1, features) and rewards (.., T)."""
    terms = _terms(seen)
    nothing = torch.nn.functional.pad(torch.zeros_like(rewards), (0, 1))
    returns = advantage(rewards, nothing, gamma, 1.0).flatten(1)[..., None].double()
    x = terms[:, :, :-1].flatten(1, 2)
    square = x.transpose(1, 2) @ x + RIDGE * torch.eye(x.shape[2], dtype=torch.float64)
    weights = torch.linalg.solve(square, x.transpose(1, 2) @ returns)
    values = (terms.flatten(1, 2) @ weights).view(seen.shape[:3]).float()
    values[..., -1] = 0.0
    return values


def _terms(seen: Tensor) -> Tensor:
    """Regressors, (seeds, environments, steps, 2 features + 4): the features, their squares, and time to the
    third power, since a path ends at its last step, so that less return remains later."""
    x = seen.double().clamp(-FEATURE_REACH, FEATURE_REACH)
    time = (torch.arange(x.shape[2], dtype=torch.float64) / TIME_STEPS)[:, None].expand(*x.shape[:3], 1)
    return torch.cat([x, x**2, time, time**2, time**3, torch.ones_like(time)], dim=3)


class StackedMlp:
    """The shape of several MLPs with tanh between layers: parameters (seeds, size), inputs (seeds, n, in).

    A natural gradient needs the same products with the Jacobian many times; explicit derivatives cost two
    matrix products per layer and need no graph.
    """

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
