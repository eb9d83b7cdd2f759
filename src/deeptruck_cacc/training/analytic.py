"""Training by the analytic gradient: back-propagation through windows of the differentiable truck.

In order: seeds and networks, the training loop, validation, saving. Several seeds run in one batch; the best
is selected on validation rollouts over fresh scenes on the same simulator, never on the truck on which it
will be tested.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import torch

from deeptruck_cacc.controllers.pedals import PedalMap
from deeptruck_cacc.controllers.scaling import ActionScale, FeatureMap
from deeptruck_cacc.environments import scenes
from deeptruck_cacc.environments.reward import Reward
from deeptruck_cacc.environments.scenes import Scene
from deeptruck_cacc.training import validation
from deeptruck_cacc.training.lent_gradient import with_gradient
from deeptruck_cacc.training.network import SeedBatch
from deeptruck_cacc.training.road import Road, Traffic, detach
from deeptruck_cacc.training.saving import Log, save
from deeptruck_cacc.training.settings import AnalyticConfig
from deeptruck_model.simulators import Simulator


def train(
    simulator: Simulator,
    out: Path,
    config: AnalyticConfig,
    *,
    reward: Reward,
    source: str,
    progress: Callable[[int, int, str], None],
) -> None:
    """Train every seed, and keep each at its best validation in `out`; see `training.train`."""
    config = replace(config, learning_rate=config.rate)
    c, late = config, config.scene == "late"

    seeds = [c.seed + k for k in range(c.seeds)]
    features = FeatureMap.default(memory=c.memory, dt=simulator.dt, power=c.memory, late=late)
    policy = SeedBatch(seeds, features, replace(ActionScale.of(simulator), exclusive=c.memory))
    policy.start_as_follower(PedalMap.calibrate(simulator))
    road = Road(with_gradient(simulator), reward)
    exam = validation.exam(c.seed, simulator.dt, copies=c.seeds, late=late)
    best = {name: tensor.detach().clone() for name, tensor in policy.state_dict().items()}
    best_scores = [float("inf")] * c.seeds
    coverage: dict[str, tuple[float, float]] = {}  # of the training scenes, by signal

    def validate() -> list[float]:
        """Scores of the seeds now; keeps the weights of those that are better than before."""
        scores = _scores(road, exam, policy, simulator.dt)
        for k, score in enumerate(scores):
            if score < best_scores[k]:
                best_scores[k] = score
                for name, tensor in policy.state_dict().items():
                    best[name][k] = tensor[k]
        return scores

    if c.memory:
        validate()  # a start that already follows may be better than what comes of it
    adam = torch.optim.Adam(policy.parameters(), lr=c.learning_rate, betas=(0.9, 0.98))
    with closing(Log(out)) as log:
        for i in range(c.iterations):
            if i % c.windows == 0:  # fresh scenes, which depend only on the seed and the path
                rng = np.random.default_rng([c.seed, i // c.windows])
                scene = scenes.DRAWERS[c.scene](rng, c.seeds * c.rollouts, c.window * c.windows, simulator.dt)
                for name, (low, high) in scenes.reach(scene).items():
                    before = coverage.get(name, (low, high))
                    coverage[name] = (min(low, before[0]), max(high, before[1]))
                state: Traffic = road.start(scene, policy)
            for group in adam.param_groups:
                group["lr"] = c.learning_rate * (0.51 + 0.49 * np.cos(np.pi * i / c.iterations))
            state, window = road.drive(scene, policy, state, c.window)
            costs = window.cost.view(c.seeds, -1).mean(dim=1)
            adam.zero_grad()
            costs.sum().backward()  # type: ignore[no-untyped-call]
            _clip(policy, c.clip)
            adam.step()
            state = detach(state)
            values: dict[str, Any] = {"cost": costs.tolist()}
            if (i + 1) % c.validate_every == 0 or i + 1 == c.iterations:
                values["validation"] = validate()
            log.write(i, values)
            says = f"cost {np.mean(values['cost']):.3f} validation {min(best_scores):.4f}"
            progress(i + 1, c.iterations, says)

    policy.load_state_dict(best)
    policies = [policy.policy(k, simulator.interface, coverage) for k in range(c.seeds)]
    save(out, policies, best_scores, config, reward, source)


def _scores(road: Road, exam: Scene, policy: SeedBatch, dt: float) -> list[float]:
    """Score of each seed: that of `validation`, plus the pedal effort that is wasted."""
    with torch.no_grad():
        _, window = road.drive(exam, policy, road.start(exam, policy), exam.steps)
    time_gap, speed, crashed, wasted = (x.double().numpy() for x in window[1:])
    rows = validation.scores(exam, dt, time_gap, speed, crashed)
    return [float(s) for s in (rows + wasted).reshape(policy.count, -1).mean(axis=1)]


def _clip(policy: SeedBatch, largest: float) -> None:
    """Limit the gradient norm of each seed; a seed whose gradient is not finite is not updated."""
    gradients = [p.grad for p in policy.parameters() if p.grad is not None]
    norm = torch.stack([g.flatten(1).norm(dim=1) for g in gradients]).norm(dim=0)
    factor = torch.where(norm.isfinite(), (largest / (norm + 1e-9)).clamp(max=1.0), torch.zeros(1))
    for g in gradients:
        g.nan_to_num_(0.0, 0.0, 0.0).mul_(factor.view(-1, *[1] * (g.dim() - 1)))
