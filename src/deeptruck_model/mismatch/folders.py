"""Checks of the folders that the mismatch commands write; standard library only."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from deeptruck_core import files
from deeptruck_core.errors import InputError
from deeptruck_core.reading import typed

APPLIED = files.Result("a corrected simulator")
CORRECTED, REFITTED = "simulator", "refitted"  # folders of a run: with forces added, with parameters alone
AS_GIVEN, REFIT, CORRECTION = "as_given", "parameters_only", "correction"  # `fit.offered` of verdict.json
PROFILE = "road_grade"  # the name in profiles.csv of a slope that was recovered
NOT_SIGNIFICANT = "over all drives, fitted ones left out in turn, the error does not fall significantly"


def apply_command(found: Path, out: Path | None = None) -> str:
    """The command that applies the simulator offered in a result."""
    return f"deeptruck-model apply {typed(found)} --out {typed(out or f'{found}_corrected')}"


def applicable(directory: Path, *, refit: bool = False) -> Path:
    """Path of the simulator to apply: the one with the least error on held-out recordings, or with `refit`
    the one with refitted parameters only. Raises InputError if it is not better than the simulator as given.
    """
    verdict = read_verdict(directory)
    offered = verdict["fit"].get("offered", CORRECTION if verdict["fit"].get("validated") else AS_GIVEN)
    if refit:
        if not _is_validated(directory / REFITTED):
            raise InputError(
                f"{directory}: refitted parameters are not applied: with them {NOT_SIGNIFICANT}; record more "
                "drives to hold out"
            )
        return directory / REFITTED
    if offered == AS_GIVEN:
        advice = verdict.get("advice", {}).get("apply", {})
        why = advice.get("reason", NOT_SIGNIFICANT)
        raise InputError(f"{directory} has no passed validation, so nothing is applied: {why}")
    return directory / (REFITTED if offered == REFIT else CORRECTED)


def _is_validated(directory: Path) -> bool:
    """Whether the manifest marks the simulator as validated."""
    try:
        return bool(json.loads((directory / "simulator.json").read_text())["validated"])
    except (OSError, ValueError, KeyError, TypeError):
        return False


def read_verdict(directory: Path) -> dict[str, Any]:
    """The content of verdict.json. Raises InputError if it is missing or damaged."""
    if not directory.exists():
        raise InputError(f"{directory} does not exist; run 'deeptruck-model mismatch' first")
    try:
        verdict = json.loads((directory / "verdict.json").read_text())
    except (OSError, ValueError, RecursionError):
        raise InputError(
            f"{directory} holds no readable verdict.json; "
            "give the folder that 'deeptruck-model mismatch' wrote"
        ) from None
    if not isinstance(verdict, dict) or not isinstance(verdict.get("fit"), dict):
        raise InputError(f"{directory / 'verdict.json'} is damaged; run 'deeptruck-model mismatch' again")
    return verdict
