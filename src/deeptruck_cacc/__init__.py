"""From a truck simulator to a following controller: environment, training, baselines, shield, evaluation."""

from deeptruck_cacc.baselines import baseline
from deeptruck_cacc.environment import CaccEnv
from deeptruck_cacc.policy import MlpPolicy, Policy, load_policy
from deeptruck_cacc.reward import Reward
from deeptruck_cacc.scenes import Scene

__all__ = ["CaccEnv", "MlpPolicy", "Policy", "Reward", "Scene", "baseline", "load_policy"]
