"""Training: `train` runs one of two trainers; both write the same policy directory."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from deeptruck_cacc.environments.reward import Reward
from deeptruck_cacc.training.settings import AnalyticConfig, Config, TrpoConfig

if TYPE_CHECKING:
    from deeptruck_cacc.controllers.policy import MlpPolicy
    from deeptruck_model.simulators import Simulator

__all__ = ["AnalyticConfig", "TrpoConfig", "train"]


def train(
    simulator: str | Simulator,
    out: str | Path,
    config: Config = AnalyticConfig(),
    *,
    reward: Reward = Reward(),
    overwrite: bool = False,
    progress: Callable[[int, int, str], None] = lambda done, total, line: None,
) -> MlpPolicy:
    """Train a policy on a simulator, by the trainer of `config`, into the policy directory `out`; return what
    was written.

    The analytic trainer uses a deep truck's own gradient, and an approximate one (`lent_gradient`) for every
    other simulator. `out` is written completely or not at all, and an older policy is replaced only with
    `overwrite`. `progress(done, total, line)` is called each iteration. Raises InputError for a simulator
    that cannot be loaded and an `out` that cannot be written.
    """
    # The command line shows its help, from the settings, where the extras are not installed.
    from threadpoolctl import threadpool_limits

    from deeptruck_cacc.controllers.loading import load_trained
    from deeptruck_cacc.controllers.policy import POLICY
    from deeptruck_model import simulators
    from deeptruck_model.results import apart

    out, source = Path(out), simulator if isinstance(simulator, str) else ""
    POLICY.check(out, overwrite=overwrite)
    if source:
        apart(out, Path(source))
    truck: Any = simulators.load(source) if source else simulator
    from deeptruck_cacc.training import analytic, trpo  # before the limit, which reaches only what is loaded

    trainer: Any = analytic if isinstance(config, AnalyticConfig) else trpo
    # one thread: of small matrices a second one only waits, at full load
    with POLICY.replacing(out, overwrite=overwrite) as draft, threadpool_limits(1):
        trainer.train(truck, draft, config, reward=reward, source=source, progress=progress)
        return load_trained(draft)
