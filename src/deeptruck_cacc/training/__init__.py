"""Trainers. `train` picks one; both write the same policy directory."""

from __future__ import annotations

from typing import Any

__all__ = ["train"]


def train(simulator: Any, out: Any, *, trainer: str = "analytic", **options: Any) -> Any:
    """Train a policy on a simulator with 'analytic' or 'trpo'; options go to that trainer's `train`.

    The analytic trainer takes a deep truck's own gradient, and lends one to every other simulator; with a
    TrpoSeedsConfig, 'trpo' trains many seeds in one batch. Imported on use: torch and Stable-Baselines3 stay
    out of a controller's process.
    """
    if trainer == "analytic":
        from deeptruck_cacc.training import analytic
        from deeptruck_cacc.training.lent_gradient import with_gradient

        return analytic.train(with_gradient(simulator), out, **options)
    if trainer == "trpo":
        from deeptruck_cacc.training import trpo, trpo_seeds

        batched = isinstance(options.get("config"), trpo_seeds.TrpoSeedsConfig)
        return (trpo_seeds if batched else trpo).train(simulator, out, **options)
    from deeptruck_model.errors import InputError

    raise InputError(f"there is no trainer '{trainer}'; known: analytic, trpo")
