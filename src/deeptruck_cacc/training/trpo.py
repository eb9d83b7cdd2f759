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
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from deeptruck_cacc.controllers.policy import MlpPolicy
from deeptruck_cacc.controllers.scaling import FeatureMap
from deeptruck_cacc.environments import scenes
from deeptruck_cacc.environments.environment import CaccEnv
from deeptruck_cacc.environments.reward import Reward
from deeptruck_cacc.training import paths, validation
from deeptruck_cacc.training.identity import identity_of
from deeptruck_cacc.training.natural_gradient import Gaussian, improve
from deeptruck_cacc.training.progress import Log, load_checkpoint, save_checkpoint
from deeptruck_cacc.training.settings import TrpoConfig
from deeptruck_cacc.training.stacked import StackedMlp
from deeptruck_model.deep.card import git_hash
from deeptruck_model.simulators import Simulator

HIDDEN = (25, 25, 25)
FEATURE_REACH, TIME_STEPS, RIDGE = 10.0, 100.0, 1e-5  # RLLab's


def train(
    simulator: Simulator,
    out: str | Path,
    config: TrpoConfig = TrpoConfig(),
    *,
    reward: Reward = Reward(),
    resume: bool = False,
    source: str = "",
    progress: Callable[[int, int, str], None] = lambda done, total, line: None,
) -> MlpPolicy:
    """Train every seed, keep each at its best validation in `out`/seeds/K and the best of them in `out`.

    `Reward.paper()` replaces `reward` if the config selects the printed one. Each iteration begins with fresh
    paths and its own random numbers, so a resumed run equals an uninterrupted one. Raises InputError for an
    unknown scene or a checkpoint of another run.
    """
    paid = Reward.paper() if config.printed_reward else reward
    return _Run(simulator, Path(out), config, paid, source).train(resume, progress)


class _Run:
    def __init__(
        self, simulator: Simulator, out: Path, config: TrpoConfig, reward: Reward, source: str
    ) -> None:
        self.out, self.config, self.identity = out, config, identity_of("trpo", config, source)
        self.env = CaccEnv(simulator, config.seeds * config.environments, config.path, reward=reward)
        self.features = FeatureMap.default(memory=config.memory, dt=simulator.dt)
        width = len(self.features.names)
        self.actor = StackedMlp((width, *HIDDEN, 2))
        self.seeds = [config.seed + k for k in range(config.seeds)]
        generators = [torch.Generator().manual_seed(seed) for seed in self.seeds]
        mean = self.actor.fresh(generators, 0.01)
        self.policy = Gaussian(self.actor, mean, torch.full((config.seeds, 2), config.log_std))
        self.best, self.best_score = mean.clone(), [float("inf")] * config.seeds
        self.exam = validation.exam(config.seed, simulator.dt, late=config.scene == "late")

    def train(self, resume: bool, progress: Callable[[int, int, str], None]) -> MlpPolicy:
        config, start = self.config, self._restore() if resume else 0
        with ExitStack() as opened:
            logs = [
                opened.enter_context(closing(Log(self.out / "seeds" / str(seed), start)))
                for seed in self.seeds
            ]
            for i in range(start, config.iterations):
                returns = self.iterate(i)
                rows: list[dict[str, Any]] = [
                    {
                        "return_mean": float(r.mean()),
                        "return_min": float(r.min()),
                        "return_max": float(r.max()),
                    }
                    for r in returns
                ]
                if (i + 1) % config.validate_every == 0 or i + 1 == config.iterations:
                    for row, score in zip(rows, self._validate(), strict=True):
                        row["validation"] = score
                    self._checkpoint(i + 1)
                for log, row in zip(logs, rows, strict=True):
                    log.write(i, row)
                progress(
                    i + 1, config.iterations, f"return {returns.mean():.1f} best {min(self.best_score):.3f}"
                )
        return self._save()

    def iterate(self, iteration: int) -> NDArray[np.float64]:
        """One batch of paths and one update of every seed; returns (seeds, environments)."""
        config = self.config
        rngs = [np.random.default_rng([seed, iteration]) for seed in self.seeds]
        seen, actions, rewards = self._drive(rngs)
        values = expected_returns(seen, rewards, config.gamma)
        advantages = paths.advantage(rewards, values, config.gamma, config.gae_lambda)
        flat = advantages.flatten(1)
        flat = (flat - flat.mean(dim=1, keepdim=True)) / (flat.std(dim=1, keepdim=True) + 1e-8)
        states = seen[:, :, :-1].flatten(1, 2)
        some = paths.draw(rngs, states.shape[1], config.curvature_share)
        most_kl = config.target_kl * (1 - iteration / config.iterations)
        self.policy = improve(self.policy, states, actions.flatten(1, 2), flat, some, most_kl)
        return rewards.sum(dim=2).double().numpy()

    def _drive(self, rngs: list[np.random.Generator]) -> paths.Paths:
        """One path in every environment of every seed."""
        c, draw = self.config, scenes.DRAWERS[self.config.scene]
        scene = [draw(rng, c.environments, c.path, self.env.dt) for rng in rngs]
        noise = np.stack([rng.standard_normal((c.path, c.environments, 2)) for rng in rngs], axis=1)
        spread = self.policy.log_std.exp()[:, None] * torch.from_numpy(noise).float()
        mean = self.policy.mean
        return paths.drive(
            self.env, scene, self.features, lambda k, seen: self.actor.forward(mean, seen)[0] + spread[k]
        )

    def _validate(self) -> list[float]:
        """Score of each seed's mean policy; stores the best weights."""
        scores = [
            validation.score(self.env.simulator, self._policy(k, self.policy.mean, {}), self.exam)
            for k in range(self.config.seeds)
        ]
        for k, score in enumerate(scores):
            if score < self.best_score[k]:
                self.best_score[k], self.best[k] = score, self.policy.mean[k]
        return scores

    def _policy(self, k: int, parameters: Tensor, card: dict[str, Any]) -> MlpPolicy:
        layers = [
            (weight[k].T.double().numpy(), bias[k, 0].double().numpy())
            for weight, bias in self.actor.layers(parameters)
        ]
        env = self.env
        reach = scenes.DRAWERS[self.config.scene](np.random.default_rng(0), 2000, env.steps, env.dt)
        coverage = scenes.reach(reach)
        return MlpPolicy(layers, self.features, env.scale, env.simulator.interface, coverage, card)

    def _checkpoint(self, done: int) -> None:
        tensors = {"mean": self.policy.mean, "log_std": self.policy.log_std, "best": self.best}
        facts = {**self.identity, "done": done, "best_score": self.best_score}
        save_checkpoint(self.out, tensors, facts)

    def _restore(self) -> int:
        """Continue from the checkpoint, if there is one; returns the number of iterations done."""
        found = load_checkpoint(self.out, self.identity)
        if found is None:
            return 0
        tensors, facts = found
        self.policy = Gaussian(self.actor, tensors["mean"], tensors["log_std"])
        self.best, self.best_score = tensors["best"], facts["best_score"]
        return int(facts["done"])

    def _save(self) -> MlpPolicy:
        """Save the best of every seed under seeds/, and the best of them in `out`."""
        policies = [self._policy(k, self.best, self._card(k)) for k in range(self.config.seeds)]
        for seed, policy in zip(self.seeds, policies, strict=True):
            policy.write_into(self.out / "seeds" / str(seed))
        winner = policies[int(np.argmin(self.best_score))]
        winner.write_into(self.out)
        return winner

    def _card(self, k: int) -> dict[str, Any]:
        return {
            **self.identity,
            "seed": self.seeds[k],
            "reward": {n: x if np.isfinite(x) else None for n, x in asdict(self.env.reward).items()},
            "git": git_hash() or "unknown",
            "validation": {"scenes": "paper and moving, fresh", "score": self.best_score[k]},
        }


def expected_returns(seen: Tensor, rewards: Tensor, gamma: float) -> Tensor:
    """Expected returns (seeds, environments, T + 1), zero at the end of a path, from observed features
    (.., T + 1, features) and rewards (.., T)."""
    terms = _terms(seen)
    nothing = torch.nn.functional.pad(torch.zeros_like(rewards), (0, 1))
    returns = paths.advantage(rewards, nothing, gamma, 1.0).flatten(1)[..., None].double()
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
