"""Trainers. `train` picks one; both write the same policy directory."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from threadpoolctl import threadpool_limits

from deeptruck_cacc.training.identity import begun, identity_of
from deeptruck_cacc.training.identity import finished as _finished
from deeptruck_model import files
from deeptruck_model.errors import InputError

__all__ = ["begun", "finished", "train"]


def train(simulator: Any, out: Any, *, trainer: str = "analytic", **options: Any) -> Any:
    """Train a policy on a simulator with 'analytic' or 'trpo'; options go to that trainer's `train`.

    The analytic trainer takes a deep truck's own gradient, and lends one to every other simulator; with a
    TrpoSeedsConfig, 'trpo' trains many seeds in one batch. Imported on use: torch and Stable-Baselines3 stay
    out of a controller's process. Raises InputError for an unknown trainer, and where another run trains
    into `out`.
    """
    if trainer not in ("analytic", "trpo"):
        raise InputError(f"there is no trainer '{trainer}'; known: analytic, trpo")
    with _folder(Path(out)), threadpool_limits(1):  # small matrices: a second thread only waits, at full load
        return (_analytic if trainer == "analytic" else _trpo)(simulator, out, **options)


def finished(out: Path, *, trainer: str, config: Any, source: str) -> bool:
    """Whether `out` already holds what this training would give; `source` names its simulator.

    Raises InputError where it holds another run's policy and nothing to go on from.
    """
    if trainer == "analytic":
        from deeptruck_cacc.training.analytic import settled

        config = settled(config)
    return _finished(out, identity_of(trainer, config, source))


@contextmanager
def _folder(out: Path) -> Iterator[None]:
    """The folder, there and held against other runs; wrong input leaves none behind."""
    out.mkdir(parents=True, exist_ok=True)
    with files.writing(out):
        try:
            yield
        except InputError:
            with suppress(OSError):  # not empty: an earlier run's
                out.rmdir()
            raise


def _analytic(simulator: Any, out: Any, **options: Any) -> Any:
    from deeptruck_cacc.training import analytic
    from deeptruck_cacc.training.lent_gradient import with_gradient

    return analytic.train(with_gradient(simulator), out, **options)


def _trpo(simulator: Any, out: Any, **options: Any) -> Any:
    from deeptruck_cacc.training import trpo, trpo_seeds

    batched = isinstance(options.get("config"), trpo_seeds.TrpoSeedsConfig)
    return (trpo_seeds if batched else trpo).train(simulator, out, **options)
