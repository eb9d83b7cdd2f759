"""Regimes of driving in which the error is: their borders, as they are printed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from small_drives import evidence

from deeptruck_model.mismatch.verdict import where


@pytest.mark.parametrize(("border", "printed"), [(2e-5, 0.0), (-2e-5, 0.0), (0.01, 0.01)])
def test_a_border_is_at_zero_where_it_is_that_near_to_it(border: float, printed: float) -> None:
    e = evidence()
    step = 1e-5 * np.where(np.arange(len(e)) % 2, 1.0, -1.0)  # the nearest slopes on both sides of the border
    slopes = 0.03 * np.sin(np.arange(len(e)) / 50.0)
    grade = border + np.where(np.abs(slopes) < 0.005, step, slopes)
    (regime,) = where.regimes(
        replace(e, signals=e.signals | {"grade": grade}), (grade > border).astype(float)
    )
    (bound,) = regime.bounds
    assert (bound.signal, bound.high) == ("grade", np.inf)
    assert bound.low == pytest.approx(printed, abs=1e-9)
    assert (bound.low == 0.0) is (printed == 0.0)
