"""All hidden effects by key, and the names a right answer may have."""

from __future__ import annotations

from deeptruck_exam import (  # noqa: F401  importing registers the effects
    alternatives,
    breakdown_records,
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
    field_reports,
    fleet_trials,
    other_makers,
    proving_ground,
)
from deeptruck_exam.hidden import EFFECTS, Effect


def of_forms(forms: str | None = None) -> list[Effect]:
    """The effects of these forms, all for None. What has no such form (a wrong parameter has no law at
    all) is the same effect in all."""
    if forms is None:
        return list(EFFECTS.values())
    own = [e for e in EFFECTS.values() if e.forms == forms]
    has = {(e.kind, e.name) for e in own}
    rest = [e for e in EFFECTS.values() if e.forms == "first" and (e.kind, e.name) not in has]
    return own if forms == "first" else [*own, *rest]


def named(forms: str | None = None) -> list[Effect]:
    """Missing physics that has a name in the house's list."""
    return [e for e in of_forms(forms) if e.kind == "missing_physics" and e.name != "unknown"]


def unknown(forms: str | None = None) -> list[Effect]:
    """Missing physics that has none."""
    return [e for e in of_forms(forms) if e.name == "unknown"]


def of_kind(kind: str, forms: str | None = None) -> list[Effect]:
    return [e for e in of_forms(forms) if e.kind == kind]


__all__ = ["EFFECTS", "Effect", "named", "of_forms", "of_kind", "unknown"]
