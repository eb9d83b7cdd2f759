"""What is time-varying: its sizes say in which recording, and when or where."""

from __future__ import annotations

from deeptruck_model.mismatch.expression import lift
from deeptruck_model.mismatch.mechanisms.over_time import spline_columns, splines
from deeptruck_model.mismatch.residual.evidence import Evidence


def test_knots_are_named_by_recording_and_place(nothing_missing: Evidence) -> None:
    made = splines(nothing_missing, lift(1.0), 1.0, "distance")
    shared, apart = {}, {}
    for spline in made:
        names = {c.name for c in spline_columns(spline, lift(1.0), "force", "N", sign=0, steady=False)}
        (shared if spline.shared else apart)[spline.spacing] = names
    for knot, names in apart.items():
        assert {f"force[a, {knot:.0f} m]", f"force[b, {knot:.0f} m]"} <= names
    for knot, names in shared.items():
        assert f"force[{knot:.0f} m]" in names
    assert apart and shared
