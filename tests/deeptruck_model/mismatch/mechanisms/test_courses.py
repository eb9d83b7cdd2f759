"""What is time-varying: its sizes say in which recording, and when or where."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from deeptruck_model.mismatch.mechanisms.courses import Spline, Where, conditions, of_all, slowly
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.residual.expression import lift


def test_knots_are_named_by_recording_and_place(nothing_missing: Evidence) -> None:
    for spline in of_distance(nothing_missing):
        knot = spline.spacing
        assert {f"force[a, {knot:.0f} m]", f"force[b, {knot:.0f} m]"} <= _names(spline)
        (shared,) = of_all(nothing_missing, spline)
        assert f"force[{shared.spacing:.0f} m]" in _names(shared)
        assert shared.spacing * (shared.knots[0] - 1) > nothing_missing["place"].max()


def test_what_is_driven_once_cannot_come_again(nothing_missing: Evidence) -> None:
    apart = nothing_missing["distance"] + np.where(nothing_missing.record == 1, 2e4, 0.0)
    once = replace(nothing_missing, signals=nothing_missing.signals | {"place": apart})
    (spline, *_) = of_distance(once)
    assert list(of_all(nothing_missing, spline)) and not list(of_all(once, spline))


def test_conditions_part_driving_at_thirds_of_each_signal(nothing_missing: Evidence) -> None:
    e = nothing_missing
    made = conditions(e)
    assert {w.signal for w in made} == {"speed", "engine", "grade"} & set(e.signals)
    for where in made:
        own = where.expression.rows(e)[e.valid]
        assert 0.25 < own.mean() < 0.75 and own.min() >= 0.0 and own.max() <= 1.0
        other = replace(where, below=not where.below)
        assert other in made
        np.testing.assert_allclose(own + other.expression.rows(e)[e.valid], 1.0)


@pytest.mark.parametrize(("signal", "width"), [("gap", 1.0), ("speed", 0.0), ("speed", float("nan"))])
def test_a_condition_is_of_a_signal_and_has_a_width(signal: str, width: float) -> None:
    with pytest.raises(ValueError, match="no condition"):
        Where(signal, 10.0, width, False)


def of_distance(e: Evidence) -> list[Spline]:
    return [s for s in slowly(1.0, "distance")(e, lift(1.0)) if isinstance(s, Spline)]


def _names(spline: Spline) -> set[str]:
    return {f"force{suffix}" for suffix, _ in spline.factors()}
