"""The choices and effort of the experiment, and the files it writes. Neither torch nor a truck is
imported.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from deeptruck_cacc.controllers.policy import POLICY
from deeptruck_model import checks, files
from deeptruck_model._io.results import FOUND, PHYSICS_TRUCK
from deeptruck_model.errors import InputError
from deeptruck_model.mismatch.folders import APPLIED

EFFECTS = ("road_grade", "brake_fade", "payload", "brake_lag", "command_delay")
FIGURES, PAGE, PICTURE, WORK = "benefit.json", "benefit.md", "benefit.png", "work"
_KEPT = (
    *(f"cases/*/old/{name}" for name in (*PHYSICS_TRUCK.names, files.LEDGER)),
    *(f"cases/*/drive*/{name}" for name in ("metadata.yaml", "*_0.mcap", files.LEDGER)),
    *(f"cases/*/found/{name}" for name in (*FOUND.names, files.LEDGER)),
    *(f"cases/*/{place}/base/{files.LEDGER}" for place in ("found/simulator", "found/refitted", "corrected")),
    *(f"cases/*/corrected/{name}" for name in (*APPLIED.names, files.LEDGER)),
    *(f"policies/*/*/{name}" for name in POLICY.names),
    "exams/*.json",
)
BENEFIT = files.Result(
    "a benefit of correction", (FIGURES, PAGE, PICTURE, *(f"{WORK}/{name}" for name in _KEPT))
)


@dataclass(frozen=True)
class Recipe:
    """How a policy is trained: scenes, memory, and the weight of errors against quiet pedals (1: as
    usual)."""

    scenes: str
    memory: bool
    care: float = 1.0


RECIPES = {
    # hidden slopes and gains, memory: prepared for what it does not know
    "default": Recipe("wide", memory=True),
    "trusting": Recipe("moving", memory=False),  # the paper's policy, sure of its simulator
    "gentle": Recipe("moving", memory=False, care=0.02),  # and not allowed to fight for the last metre
}


@dataclass(frozen=True)
class Effort:
    """The amount of training and driving."""

    seeds: int = 3
    iterations: int = 90
    rollouts: int = 40
    """test paths for each policy and scene"""
    paths: int = 20
    """training paths for each seed"""
    window: int = 200
    """steps a gradient reaches back"""


def check(
    out: Path,
    effects: Sequence[str],
    recipes: Sequence[str],
    *,
    resume: bool = False,
    overwrite: bool = False,
) -> None:
    """Check the arguments before anything is loaded. Raises InputError for unknown effects and recipes, an
    older result without `overwrite`, and an unfinished one without `resume` or `overwrite`."""
    checks.every(
        partial(_known, "effect", effects, EFFECTS),
        partial(_known, "recipe", recipes, tuple(RECIPES)),
        partial(BENEFIT.check_start, out, resume=resume, overwrite=overwrite),
    )


def _known(kind: str, given: Sequence[str], known: Sequence[str]) -> None:
    if unknown := [f"'{name}'" for name in given if name not in known]:
        raise InputError(f"there is no {kind} {', '.join(unknown)}; known: {', '.join(known)}")
