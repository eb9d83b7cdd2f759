"""Training by TRPO (sb3-contrib) in the paper's setting.

Batch 20,000, paths of 800, gamma 0.9999, a Gaussian over an MLP of 3 x 25.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from deeptruck_cacc.controllers.policy import MlpPolicy
from deeptruck_cacc.environments import scenes
from deeptruck_cacc.environments.adapters import CaccSb3VecEnv
from deeptruck_cacc.environments.reward import Reward
from deeptruck_cacc.training import progress, validation
from deeptruck_cacc.training.identity import identity_of
from deeptruck_cacc.training.settings import TrpoConfig
from deeptruck_model.simulators import Simulator


def train(
    simulator: Simulator,
    out: str | Path,
    config: TrpoConfig = TrpoConfig(),
    *,
    reward: Reward = Reward(),
    resume: bool = False,
    source: str = "",
    tell: Callable[[int, int, str], None] = lambda done, total, says: None,
) -> MlpPolicy:
    """Train one seed, keep the iteration that validated best in `out`, and return it.

    Every iteration begins with fresh paths and its own random numbers, so a resumed run equals an unbroken
    one. Raises InputError for an unknown scene or a foreign checkpoint.
    """
    out = Path(out)
    model, env = _model(simulator, config, reward)
    exam = validation.exam(config.seed, simulator.dt, late=config.scene == "late")
    best: dict[str, Tensor] = {}
    best_score, start = float("inf"), 0
    identity = identity_of("trpo", config, source)
    found = progress.load_checkpoint(out, identity) if resume else None
    if found is not None:
        best, best_score, start = _restore(model, *found)
    log = progress.Log(out, start)
    for i in range(start, config.iterations):
        returns = _iterate(model, env, config, i)
        values: dict[str, Any] = {
            "return_mean": float(returns.mean()),
            "return_min": float(returns.min()),
            "return_max": float(returns.max()),
        }
        if (i + 1) % config.validate_every == 0 or i + 1 == config.iterations:
            score = validation.score(simulator, _policy(model.policy.state_dict(), env, {}), exam)
            values["validation"] = score
            if score < best_score or not best:
                best_score, best = score, {n: t.clone() for n, t in model.policy.state_dict().items()}
            _checkpoint(out, model, best, {**identity, "done": i + 1, "best_score": best_score})
        log.write(i, values)
        tell(i + 1, config.iterations, f"return {returns.mean():.1f} best validation {best_score:.3f}")
    log.close()
    card = {
        **identity,
        "seed": config.seed,
        "reward": asdict(reward),
        "git": progress.git_hash(),
        "validation": {"scenes": "paper and moving, fresh", "score": best_score},
    }
    policy = _policy(best, env, card)
    policy.write_into(out)
    return policy


def _model(simulator: Simulator, config: TrpoConfig, reward: Reward) -> tuple[Any, CaccSb3VecEnv]:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        from sb3_contrib import TRPO
        from stable_baselines3.common.logger import Logger
    env = CaccSb3VecEnv(
        simulator,
        config.environments,
        steps=config.path,
        scene=config.scene,
        reward=reward,
        memory=config.memory,
        seed=config.seed,
    )
    net = {"net_arch": [25, 25, 25], "activation_fn": torch.nn.Tanh, "log_std_init": config.log_std}
    model = TRPO(
        "MlpPolicy",
        env,
        n_steps=config.path,
        batch_size=config.path,
        gamma=config.gamma,
        gae_lambda=config.gae_lambda,
        target_kl=config.target_kl,
        policy_kwargs=net,
        seed=config.seed,
        device="cpu",
    )
    model.set_logger(Logger(folder=None, output_formats=[]))  # its own would leave an empty folder in /tmp
    return model, env


def _iterate(model: Any, env: CaccSb3VecEnv, config: TrpoConfig, iteration: int) -> NDArray[np.float64]:
    """One batch and one update; the returns of its paths."""
    model.set_random_seed((config.seed * 1_000_003 + iteration) % 2**32)  # the environment's seed as well
    model._last_obs = None  # sb3 then resets the environment, which takes the seed
    steps = config.environments * config.path
    model.learn(steps, reset_num_timesteps=False)
    return env.last_returns


def _policy(state: dict[str, Tensor], env: CaccSb3VecEnv, card: dict[str, Any]) -> MlpPolicy:
    """The Gaussian's mean as the numpy policy."""
    count = sum(name.startswith("mlp_extractor.policy_net") and name.endswith("weight") for name in state)
    names = [f"mlp_extractor.policy_net.{2 * k}" for k in range(count)] + ["action_net"]
    layers = [
        (state[f"{n}.weight"].numpy().astype(float), state[f"{n}.bias"].numpy().astype(float)) for n in names
    ]
    cacc = env.cacc
    rng = np.random.default_rng(0)
    coverage = scenes.reach(cacc.draw(rng, 2000, cacc.steps, cacc.dt))
    return MlpPolicy(layers, env.features, cacc.scale, cacc.simulator.interface, coverage, card)


def _checkpoint(out: Path, model: Any, best: dict[str, Tensor], facts: dict[str, Any]) -> None:
    tensors = {f"now.{name}": t for name, t in model.policy.state_dict().items()}
    tensors |= {f"best.{name}": t for name, t in best.items()}
    tensors |= progress.adam_tensors(model.policy.optimizer)
    progress.save_checkpoint(out, tensors, facts)


def _restore(
    model: Any, tensors: dict[str, Tensor], facts: dict[str, Any]
) -> tuple[dict[str, Tensor], float, int]:
    model.policy.load_state_dict({n[4:]: t for n, t in tensors.items() if n.startswith("now.")})
    progress.restore_adam(model.policy.optimizer, tensors)
    model.num_timesteps = facts["done"] * facts["config"]["environments"] * facts["config"]["path"]
    best = {n[5:]: t for n, t in tensors.items() if n.startswith("best.")}
    return best, float(facts["best_score"]), int(facts["done"])
