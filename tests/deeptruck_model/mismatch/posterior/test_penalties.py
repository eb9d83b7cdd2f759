"""What is large enough to be said, and what a form that follows anything must gain."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from deeptruck_model.mismatch.mechanisms.variants import Spline, Static, Variant
from deeptruck_model.mismatch.posterior import penalties
from deeptruck_model.mismatch.rules import Rules


def model(score: float, *variants: Variant) -> Any:
    named = tuple(SimpleNamespace(variant=v) for v in variants)
    return SimpleNamespace(rules=Rules(), score=score, named=named)


@pytest.mark.parametrize(("gain", "paid"), [(80.0, Rules.least_gain), (1000.0, 1000.0 * Rules.form_share)])
def test_what_comes_and_goes_pays_for_following_anything(gain: float, paid: float) -> None:
    base = model(500.0)
    spline = Spline("elapsed", (4, 4), ("a", "b"), 20.0, 0.125, 0.1)
    assert penalties.time_varying_penalty(model(500.0 + gain, spline), base) == pytest.approx(paid)
    assert penalties.time_varying_penalty(model(500.0 + gain, Static()), base) == 0.0
    assert penalties.time_varying_penalty(base, base) == 0.0
