"""All hidden effects by key, and the names a right answer may have."""

from __future__ import annotations

from deeptruck_model.mismatch.proof import (  # noqa: F401  importing registers the effects
    effects_air,
    effects_brakes,
    effects_commands,
    effects_data,
    effects_driveline,
    effects_engine,
    effects_load,
    effects_tyres,
    effects_unknown,
    effects_unknown_machine,
)
from deeptruck_model.mismatch.proof.hidden import EFFECTS, Effect


def named() -> list[Effect]:
    """Missing physics that has a name in the house's list."""
    return [e for e in EFFECTS.values() if e.kind == "missing_physics" and e.name != "unknown"]


def unknown() -> list[Effect]:
    """Missing physics that has none."""
    return [e for e in EFFECTS.values() if e.name == "unknown"]


def of_kind(kind: str) -> list[Effect]:
    return [e for e in EFFECTS.values() if e.kind == kind]


__all__ = ["EFFECTS", "Effect", "named", "of_kind", "unknown"]
