"""Names in forms that are not the textbook's: any curve of their own variables, and of these alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from deeptruck_model.mismatch.mechanisms import LIBRARY
from deeptruck_model.mismatch.mechanisms.own_forms import OWN, Form, apart, curve, curves, knots
from deeptruck_model.mismatch.residual.evidence import Evidence

AT = [1.0, 4.0, 6.0, 9.0]


def test_every_form_belongs_to_a_name() -> None:
    assert set(OWN) <= set(LIBRARY)


@pytest.mark.parametrize("level", [False, True])
@pytest.mark.parametrize("trend", ["rising", "falling", "any"])
def test_no_curve_leaves_its_trend_whatever_its_sizes(
    trend: str, level: bool, nothing_missing: Evidence
) -> None:
    speed = np.linspace(0.0, 12.0, len(nothing_missing))
    e = replace(nothing_missing, signals=nothing_missing.signals | {"speed": speed})
    form = replace(OWN["rolling_resistance_speed"][0], trend=trend, level=level)  # type: ignore[arg-type]
    pieces = [x.rows(e) for x, _ in curve(form, AT)]
    assert len(pieces) == (4 if level or trend == "any" else 3)
    for sizes in np.random.default_rng(1).exponential(size=(20, len(pieces))):
        y = sizes @ np.array(pieces)
        steps = np.diff(y)
        assert y.min() >= 0.0
        assert trend != "rising" or (steps.min() >= -1e-12 and (level or y[0] == 0.0))
        assert trend != "falling" or (steps.max() <= 1e-12 and (level or y[-1] == 0.0))


def test_what_grows_with_speed_is_nothing_at_a_stand(nothing_missing: Evidence) -> None:
    speed = np.linspace(0.0, 12.0, len(nothing_missing))
    e = replace(nothing_missing, signals=nothing_missing.signals | {"speed": speed})
    form = next(f for f in OWN["rolling_resistance_speed"] if f.trend == "rising")
    assert all(x.rows(e)[0] == 0.0 < x.rows(e)[-1] for x, _ in curve(form, AT))


def test_a_form_is_offered_where_its_variable_moves_and_its_carrier_acts(nothing_missing: Evidence) -> None:
    e = nothing_missing
    assert {c.index for c in curves("brake_fade", e)} == set(range(len(OWN["brake_fade"])))
    still = replace(e, signals=e.signals | {"speed": np.full(len(e), 15.0)})
    assert not list(curves("rolling_resistance_speed", still))
    never = replace(e, signals=e.signals | {"brake": np.zeros(len(e))})
    assert not list(curves("brake_fade", never))
    assert not list(curves("rotating_inertia", e))  # the ratio is not known here


def test_forms_are_data_and_need_no_fit() -> None:
    for each in OWN.values():
        for form in each:
            assert isinstance(form, Form) and form.by and form.sd > 0
            assert list(form.knots) == sorted(form.knots)


def test_an_engine_power_is_the_pull_times_speed(nothing_missing: Evidence) -> None:
    e = nothing_missing
    forms = [(name, form) for name, each in OWN.items() for form in each if form.by == "engine power"]
    assert {name for name, _ in forms} == {"torque_derate", "torque_limit"}
    for _, form in forms:
        np.testing.assert_allclose(form.of.rows(e), np.maximum(e["engine"], 0.0) * e["speed"])


def test_knots_stand_apart() -> None:
    """A truck that cruises at one speed would have several knots within the noise of its sensor."""
    assert apart(np.array([1.0, 21.98, 22.0, 22.02, 25.0])) == (1.0, 21.98, 25.0)
    assert apart(np.array([5.0, 5.0, 5.0])) == (5.0,)


def test_a_time_that_is_mostly_long_ago_has_its_knots_where_it_is_not() -> None:
    since = np.concatenate([np.linspace(0.0, 3.9, 100), np.full(900, 4.0)])
    at = knots(since, (0.02, 0.35, 0.65, 0.98))
    assert at[-1] == 4.0 and len(at) == 5 and at[2] < 2.6
    assert knots(np.linspace(0.0, 4.0, 1000), (0.5,)) == pytest.approx([2.0])
