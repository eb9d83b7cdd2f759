"""The baseline of TRPO: the expected return from each state of a path, with which an action is compared.

It is a least-squares fit to returns of any size, as in RLLab, with which the paper trained. RLLab fits it to
the previous batch; after a crash in that batch its error is many times what it explains, so ours is fitted to
the current batch: a dozen weights to 20,000 steps.
"""

from __future__ import annotations

import torch
from torch import Tensor

from deeptruck_cacc.training import paths

FEATURE_REACH, TIME_STEPS, RIDGE = 10.0, 100.0, 1e-5  # RLLab's


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
