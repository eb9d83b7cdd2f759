"""What varies: curves of any monotone shape over a mechanism's own variables, and courses, whose sizes say
in which recording, and when or where."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from deeptruck_model.mismatch.mechanisms import LIBRARY
from deeptruck_model.mismatch.mechanisms.courses import Spline, Where, conditions, of_all, slowly
from deeptruck_model.mismatch.mechanisms.record import Curve, Trend
from deeptruck_model.mismatch.mechanisms.terms import every_variant, pieces
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.residual.expression import Signal, lift

AT = [1.0, 4.0, 6.0, 9.0]


OVER_SPEED = Curve(lift(-1.0), Signal("speed"), "speed", "rising", share=False)


def offered(effect: str, e: Evidence) -> set[str]:
    """Names of the curves of a mechanism that recordings can show."""
    forms = LIBRARY[effect].forms
    return {v.form for v in every_variant(LIBRARY[effect], e) if isinstance(forms[v.form], Curve)}


@pytest.mark.parametrize("level", [False, True])
@pytest.mark.parametrize("trend", ["rising", "falling", "any"])
def test_no_curve_leaves_its_trend_whatever_its_sizes(
    trend: Trend, level: bool, nothing_missing: Evidence
) -> None:
    speed = np.linspace(0.0, 12.0, len(nothing_missing))
    e = replace(nothing_missing, signals=nothing_missing.signals | {"speed": speed})
    of_trend = replace(OVER_SPEED, trend=trend, level=level)
    rows = [x.rows(e) for x, _ in pieces(of_trend, AT)]
    assert len(rows) == (4 if level or trend == "any" else 3)
    for sizes in np.random.default_rng(1).exponential(size=(20, len(rows))):
        y = sizes @ np.array(rows)
        steps = np.diff(y)
        assert y.min() >= 0.0
        assert trend != "rising" or (steps.min() >= -1e-12 and (level or y[0] == 0.0))
        assert trend != "falling" or (steps.max() <= 1e-12 and (level or y[-1] == 0.0))


def test_a_curve_is_offered_where_its_variable_moves_and_its_carrier_acts(nothing_missing: Evidence) -> None:
    e = nothing_missing
    assert offered("brake_fade", e) == {f"braking power over {s} s" for s in (20, 60, 200, 600)}
    still = replace(e, signals=e.signals | {"speed": np.full(len(e), 15.0)})
    assert not offered("rolling_resistance_speed", still)
    never = replace(e, signals=e.signals | {"brake": np.zeros(len(e))})
    assert not offered("brake_fade", never)
    assert not offered("rotating_inertia", e)  # the ratio is not known here


def test_none_is_offered_for_a_learned_simulator(nothing_missing: Evidence) -> None:
    assert offered("brake_fade", nothing_missing)
    assert not offered("brake_fade", replace(nothing_missing, model_discrepancy=0.05))


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
