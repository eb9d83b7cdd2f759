"""What comes and goes: its sizes say in which recording, and when or where."""

from __future__ import annotations

from deeptruck_model.mismatch.expression import lift
from deeptruck_model.mismatch.mechanisms.over_time import slow_columns, slow_settings
from deeptruck_model.mismatch.residual.evidence import Evidence


def test_knots_are_named_by_recording_and_place(nothing_missing: Evidence) -> None:
    made = slow_settings(nothing_missing, lift(1.0), 1.0, "distance")
    shared, apart = {}, {}
    for settings in made:
        names = {c.name for c in slow_columns(settings, lift(1.0), "force", "N", sign=0, steady=False)}
        (shared if "shared" in settings else apart)[settings["knot"]] = names
    for knot, names in apart.items():
        assert {f"force[a, {knot:.0f} m]", f"force[b, {knot:.0f} m]"} <= names
    for knot, names in shared.items():
        assert f"force[{knot:.0f} m]" in names
    assert apart and shared
