"""Trains a following controller on a truck simulator: environment, trainers, baselines, shield and
evaluation.
"""

import sys
from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from deeptruck_cacc.controllers.baselines import baseline
    from deeptruck_cacc.controllers.loading import load_policy
    from deeptruck_cacc.controllers.policy import MlpPolicy, Policy
    from deeptruck_cacc.environments.environment import CaccEnv
    from deeptruck_cacc.environments.reward import Reward
    from deeptruck_cacc.environments.scenes import Scene

__all__ = ["CaccEnv", "MlpPolicy", "Policy", "Reward", "Scene", "baseline", "load_policy"]

_HOMES = {
    "CaccEnv": "environments.environment",
    "MlpPolicy": "controllers.policy",
    "Policy": "controllers.policy",
    "Reward": "environments.reward",
    "Scene": "environments.scenes",
    "baseline": "controllers.baselines",
    "load_policy": "controllers.loading",
}


if "gymnasium" in sys.modules:  # which is not loaded for it: the console script answers at once
    from deeptruck_cacc.environments.registration import register

    register()


def __getattr__(name: str) -> Any:
    """Load a public name on first use, so that the console script starts fast."""
    if name not in _HOMES:
        raise AttributeError(f"module 'deeptruck_cacc' has no attribute '{name}'")
    return getattr(import_module(f"deeptruck_cacc.{_HOMES[name]}"), name)
