"""Curves: forms of any monotone shape over a mechanism's own variables."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from deeptruck_model.mismatch.mechanisms import LIBRARY
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
