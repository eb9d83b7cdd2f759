"""Names and checks of an evaluation's output files; imports neither figures nor trucks."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from deeptruck_cacc.controllers.loading import PLANNER, load_policy
from deeptruck_cacc.controllers.policy import Policy
from deeptruck_core import files
from deeptruck_core.errors import InputError
from deeptruck_model import checks
from deeptruck_model.results import apart

METRICS, CURVE, STABILITY = "metrics.json", "learning_curve.png", "string_stability.png"
PAGE = "evaluation.html"
FIELD = ("gap_closing", "long_following")
VARIANTS = {  # name: (parameter, value, scene): a truck other than the one trained for
    "payload_light": ("mass", 10e3, "moving"),
    "payload_heavy": ("mass", 36e3, "moving"),
    "wet_road": ("tyre_friction", 0.4, "stop"),
}
LEADERS = ("human", "acc")  # recorded ones
EVALUATION = files.Result("an evaluation of a policy")


def check(
    policy: str,
    simulator: str,
    out: Path,
    *,
    all_seeds: bool = False,
    overwrite: bool = False,
    planner: str = "",
) -> None:
    """Check the arguments before anything is driven, without torch. Raises InputError with all errors: an
    `out` that holds something else, or an evaluation without `overwrite`; a missing policy or simulator, or
    two that do not fit; no seeds with `all_seeds`."""

    def policies() -> list[str]:
        return [str(path) for path in seed_folders(Path(policy))] if all_seeds else [policy]

    def fit() -> None:
        facts = checks.simulator(simulator)
        for path in policies():
            check_dt(load_policy(path, facts.interface), facts.dt)
        if planner:
            check_dt(load_policy(f"{PLANNER}{planner}", facts.interface), facts.dt)

    checks.every(
        lambda: [load_policy(path) for path in policies()],
        fit,
        partial(checks.simulator, simulator),
        partial(EVALUATION.check, out, overwrite=overwrite),
        partial(apart, out, Path(policy.removeprefix(PLANNER)), Path(simulator)),
    )


def check_dt(driver: Policy, dt: float) -> None:
    """Raises InputError if the time step of a policy differs from the simulator's `dt` (s)."""
    if abs(driver.dt - dt) > 1e-9:
        raise InputError(f"the policy acts every {driver.dt:g} s, the simulator steps by {dt:g} s")


def seed_folders(policy: Path) -> list[Path]:
    """The policies of all seeds under `policy`. Raises InputError if there are none."""
    folders = sorted(p for p in (policy / "seeds").glob("*") if (p / "policy.json").exists())
    if not folders:
        raise InputError(
            f"{policy} has no seeds; train with --seeds, or one policy for each K as {policy}/seeds/K"
        )
    return folders
