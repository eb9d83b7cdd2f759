"""Training by the analytic gradient: back-propagation through windows of the differentiable truck.

In order: settings, the training loop, validation, saving. Several seeds run in one batch; the best is
selected on validation rollouts over fresh scenes on the same simulator, never on the truck on which it will
be tested.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from deeptruck_cacc.controllers.pedals import PedalMap
from deeptruck_cacc.controllers.policy import MlpPolicy
from deeptruck_cacc.controllers.scaling import ActionScale, FeatureMap
from deeptruck_cacc.environments import scenes
from deeptruck_cacc.environments.reward import Reward
from deeptruck_cacc.environments.scenes import Scene
from deeptruck_cacc.training import validation
from deeptruck_cacc.training.identity import identity_of
from deeptruck_cacc.training.network import SeedBatch
from deeptruck_cacc.training.progress import (
    Log,
    adam_tensors,
    load_checkpoint,
    restore_adam,
    save_checkpoint,
)
from deeptruck_cacc.training.road import Road, Traffic, detach
from deeptruck_cacc.training.settings import AnalyticConfig, settled
from deeptruck_core.errors import InputError
from deeptruck_model.deep.card import git_hash
from deeptruck_model.simulators import Simulator


def train(
    simulator: Simulator,
    out: str | Path,
    config: AnalyticConfig = AnalyticConfig(),
    *,
    reward: Reward = Reward(),
    resume: bool = False,
    source: str = "",
    progress: Callable[[int, int, str], None] = lambda done, total, line: None,
) -> MlpPolicy:
    """Train, keep the best seed in `out` and every seed in `out`/seeds/K, and return the best.

    `simulator` needs `torch_module()`: a deep truck has it, `lent_gradient` provides it for any other.
    `progress(done, total, line)` is called each iteration. Raises InputError for a simulator without
    gradients, an unknown scene, or a checkpoint of another run.
    """
    if not hasattr(simulator, "torch_module"):
        raise InputError(
            "this simulator has no gradient; lend it one by training.lent_gradient.with_gradient"
        )
    return _Run(simulator, Path(out), settled(config), reward, source).train(resume, progress)


class _Run:
    def __init__(
        self, simulator: Simulator, out: Path, config: AnalyticConfig, reward: Reward, source: str
    ) -> None:
        self.simulator, self.out, self.config = simulator, out, config
        self.identity = identity_of("analytic", config, source)
        self.road, self.reward = Road(simulator, reward), reward
        late = config.scene == "late"
        features = FeatureMap.default(memory=config.memory, dt=simulator.dt, power=config.memory, late=late)
        scale = replace(ActionScale.of(simulator), exclusive=config.memory)
        self.policy = SeedBatch([config.seed + k for k in range(config.seeds)], features, scale)
        self.policy.start_as_follower(PedalMap.calibrate(simulator))
        self.adam = torch.optim.Adam(self.policy.parameters(), lr=config.learning_rate, betas=(0.9, 0.98))
        self.best = {name: t.detach().clone() for name, t in self.policy.state_dict().items()}
        self.best_score = [float("inf")] * config.seeds
        self.seen: dict[str, tuple[float, float]] = {}
        self.exam = validation.exam(config.seed, simulator.dt, copies=config.seeds, late=late)

    def train(self, resume: bool, progress: Callable[[int, int, str], None]) -> MlpPolicy:
        config, start = self.config, self._restore() if resume else 0
        log = Log(self.out, start)
        state, scene, score = None, None, ""
        if config.memory and not start:
            self._validate()  # a start that already follows may be better than what comes of it
        with closing(log):  # else TensorBoard's thread may write after the folder of a failed run is removed
            for i in range(start, config.iterations):
                if state is None or scene is None or i % config.windows == 0:
                    scene = self._draw(i // config.windows)
                    state = self.road.start(scene, self.policy)
                for group in self.adam.param_groups:
                    group["lr"] = config.learning_rate * (0.51 + 0.49 * np.cos(np.pi * i / config.iterations))
                state, costs = self._update(scene, state)
                values: dict[str, Any] = {"cost": costs}
                if (i + 1) % config.validate_every == 0 or i + 1 == config.iterations:
                    values["validation"] = self._validate()
                    score = f"validation {min(self.best_score):.4f}"
                log.write(i, values)
                if (i + 1) % config.windows == 0:
                    self._checkpoint(i + 1)
                progress(i + 1, config.iterations, f"cost {np.mean(costs):.3f} {score}")
        return self._save()

    def _draw(self, path: int) -> Scene:
        """Fresh scenes for a path, which depend only on the seed and the path."""
        c = self.config
        rng = np.random.default_rng([c.seed, path])
        scene = scenes.DRAWERS[c.scene](rng, c.seeds * c.rollouts, c.window * c.windows, self.simulator.dt)
        for name, (low, high) in scenes.reach(scene).items():
            before = self.seen.get(name, (low, high))
            self.seen[name] = (min(low, before[0]), max(high, before[1]))
        return scene

    def _update(self, scene: Scene, state: Traffic) -> tuple[Traffic, list[float]]:
        """One gradient step of every seed; returns the state after the window, and each seed's cost."""
        state, window = self.road.drive(scene, self.policy, state, self.config.window)
        costs = window.cost.view(self.config.seeds, -1).mean(dim=1)
        self.adam.zero_grad()
        costs.sum().backward()  # type: ignore[no-untyped-call]
        self._clip()
        self.adam.step()
        return detach(state), costs.tolist()

    def _clip(self) -> None:
        """Limit the gradient of each seed; a seed whose gradient is not finite is not updated."""
        gradients = [p.grad for p in self.policy.parameters() if p.grad is not None]
        norm = torch.stack([g.flatten(1).norm(dim=1) for g in gradients]).norm(dim=0)
        factor = torch.where(
            norm.isfinite(), (self.config.clip / (norm + 1e-9)).clamp(max=1.0), torch.zeros(1)
        )
        for g in gradients:
            g.nan_to_num_(0.0, 0.0, 0.0).mul_(factor.view(-1, *[1] * (g.dim() - 1)))

    def _validate(self) -> list[float]:
        """Score of each seed, the score of `validation` plus the pedal effort that is wasted; keeps the best
        weights."""
        with torch.no_grad():
            start = self.road.start(self.exam, self.policy)
            _, window = self.road.drive(self.exam, self.policy, start, self.exam.steps)
        time_gap, speed, crashed, wasted = (x.double().numpy() for x in window[1:])
        rows = validation.scores(self.exam, self.simulator.dt, time_gap, speed, crashed)
        scores = [float(s) for s in (rows + wasted).reshape(self.config.seeds, -1).mean(axis=1)]
        for k, score in enumerate(scores):
            if score < self.best_score[k]:
                self.best_score[k] = score
                for name, tensor in self.policy.state_dict().items():
                    self.best[name][k] = tensor[k]
        return scores

    def _checkpoint(self, done: int) -> None:
        tensors: dict[str, Tensor] = {f"now.{name}": t for name, t in self.policy.state_dict().items()}
        tensors |= {f"best.{name}": t for name, t in self.best.items()}
        tensors |= adam_tensors(self.adam)
        facts = {**self.identity, "done": done, "best_score": self.best_score, "seen": self.seen}
        save_checkpoint(self.out, tensors, facts)

    def _restore(self) -> int:
        """Continue from the checkpoint, if there is one; returns the number of iterations done."""
        found = load_checkpoint(self.out, self.identity)
        if found is None:
            return 0
        tensors, facts = found
        self.policy.load_state_dict({n[4:]: t for n, t in tensors.items() if n.startswith("now.")})
        self.best = {n[5:]: t for n, t in tensors.items() if n.startswith("best.")}
        restore_adam(self.adam, tensors)
        self.best_score = facts["best_score"]
        self.seen = {name: (low, high) for name, (low, high) in facts["seen"].items()}
        return int(facts["done"])

    def _save(self) -> MlpPolicy:
        """Save the best of every seed under seeds/, and the best of them in `out`."""
        self.policy.load_state_dict(self.best)
        winner = int(np.argmin(self.best_score))
        for k in range(self.config.seeds):
            policy = self._policy(k)
            policy.write_into(self.out / "seeds" / str(self.config.seed + k))
            if k == winner:
                policy.write_into(self.out)
        return self._policy(winner)

    def _policy(self, k: int) -> MlpPolicy:
        card = {
            **self.identity,
            "seed": self.config.seed + k,
            "reward": asdict(self.reward),
            "git": git_hash() or "unknown",
            "validation": {"scenes": "paper and moving, fresh", "score": self.best_score[k]},
        }
        return self.policy.policy(k, self.simulator.interface, dict(self.seen), card)
