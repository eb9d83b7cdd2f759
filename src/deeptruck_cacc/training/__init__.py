"""Training: `train` calls one of two trainers; both write the same policy directory."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from threadpoolctl import threadpool_limits

from deeptruck_cacc.controllers.loading import load_trained
from deeptruck_cacc.controllers.policy import MANIFEST, POLICY, MlpPolicy
from deeptruck_cacc.environments.reward import Reward
from deeptruck_cacc.training.identity import (
    differences,
    facts_of,
    finished,
    identity_of,
    refuse_another,
)
from deeptruck_cacc.training.settings import AnalyticConfig, Config, TrpoConfig, settled
from deeptruck_core.errors import InputError
from deeptruck_core.files import unfinished

if TYPE_CHECKING:
    from deeptruck_model.simulators import Simulator

__all__ = ["begun", "check", "check_place", "default", "train"]

TRAINERS = ("analytic", "trpo")


def train(
    simulator: Simulator,
    out: str | Path,
    *,
    trainer: str = "analytic",
    config: Config | None = None,
    reward: Reward = Reward(),
    resume: bool = False,
    overwrite: bool = False,
    source: str = "",
    progress: Callable[[int, int, str], None] = lambda done, total, line: None,
) -> MlpPolicy:
    """Train a policy on a simulator with 'analytic' or 'trpo' into the policy directory `out`; return it.

    An interrupted run leaves `files.unfinished(out)`, which `resume` continues with the same result as an
    uninterrupted run. `overwrite` replaces an older policy once the new one is complete. The analytic trainer
    uses a deep truck's own gradient, and an approximate one (`lent_gradient`) for every other simulator.
    `source` names the simulator in checkpoints and card; `progress(done, total, line)` is called each
    iteration. The trainer is imported on use, so that a controller's process does not load torch. Raises
    InputError as `check` does, and if another run trains into `out`.
    """
    out, config = Path(out), config or default(trainer)
    if check(out, trainer=trainer, config=config, source=source, resume=resume, overwrite=overwrite):
        return load_trained(out)
    run = _trainer(trainer, config)
    import_module("torch")  # the limit reaches only what is loaded
    # one thread: of small matrices a second one only waits, at full load
    goes_on = resume and begun(out)
    with POLICY.going_on(out, overwrite=overwrite, resume=goes_on) as draft, threadpool_limits(1):
        return run(simulator, draft, config, reward=reward, resume=resume, source=source, progress=progress)


def check(
    out: Path,
    *,
    trainer: str = "analytic",
    config: Config | None = None,
    source: str = "",
    resume: bool = False,
    overwrite: bool = False,
) -> bool:
    """Return True if the training to `resume` is already complete; called before torch and data are loaded.

    Raises InputError for an unknown trainer, a config of the other trainer, an existing policy without
    `overwrite`, and an unfinished training without `resume` or `overwrite`. With `resume`, also for a
    training that is damaged or that was begun with other settings.
    """
    config = config or default(trainer)
    if isinstance(config, AnalyticConfig) != (trainer == "analytic"):
        raise InputError(f"the {trainer} trainer has no settings of {type(config).__name__}")
    wanted = settled(config) if isinstance(config, AnalyticConfig) else config
    identity = identity_of(trainer, wanted, source)
    if resume and finished(out, identity):
        return True
    check_place(out, resume=resume, overwrite=overwrite)
    if resume and begun(out):
        refuse_another(out, differences(facts_of(unfinished(out)), identity))
    return False


def check_place(out: Path, *, resume: bool = False, overwrite: bool = False) -> None:
    """Check that a policy can be trained into `out`; with `resume` a finished one is left to `check`.

    Raises InputError for an older policy without `overwrite`, or an unfinished training without `resume` or
    `overwrite`.
    """
    if resume and not begun(out) and (out / MANIFEST).exists():
        return
    POLICY.check_start(out, resume=resume, overwrite=overwrite)


def begun(out: Path) -> bool:
    """Whether an interrupted training into `out` has a checkpoint."""
    return POLICY.begun(out)


def default(trainer: str) -> Config:
    """The settings of a trainer. Raises InputError for an unknown one."""
    if trainer not in TRAINERS:
        raise InputError(f"there is no trainer '{trainer}'; known: {', '.join(TRAINERS)}")
    return AnalyticConfig() if trainer == "analytic" else TrpoConfig()


def _trainer(trainer: str, config: Config) -> Callable[..., MlpPolicy]:
    if trainer == "analytic":
        return _analytic
    from deeptruck_cacc.training import trpo

    return trpo.train


def _analytic(simulator: Simulator, draft: Path, config: AnalyticConfig, **options: Any) -> MlpPolicy:
    from deeptruck_cacc.training import analytic
    from deeptruck_cacc.training.lent_gradient import with_gradient

    return analytic.train(with_gradient(simulator), draft, config, **options)
