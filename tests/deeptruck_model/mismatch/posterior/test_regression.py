"""The linear model of the residual, on small drives whose truth is known."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from small_drives import N, evidence

from deeptruck_model.mismatch.mechanisms import LIBRARY
from deeptruck_model.mismatch.posterior.regression import (
    HELD,
    LARGEST_SLOPE,
    Regression,
    changed_by,
)
from deeptruck_model.mismatch.residual.noise import Fit, fit

WEAKER = -0.2  # the brakes, which nothing else resembles


@cache
def search(change: float = WEAKER) -> Regression:
    return Regression(evidence(-change * evidence()["brake"]), exclude=LIBRARY)


@pytest.mark.parametrize("gain", [1.0, 0.8])
@pytest.mark.parametrize("x", [-0.5, -0.1, 0.0, 0.3, 1.0, 2.0])
def test_forces_act_by_one_over_the_mass(x: float, gain: float) -> None:
    """A mass larger by x gives 1 / (1 + gain x) of the acceleration, in linear terms x / (1 + gain x)."""
    assert changed_by("mass", x / (1.0 + gain * x), gain) == pytest.approx(x)


def test_no_slope_gives_an_endless_mass() -> None:
    largest = changed_by("mass", LARGEST_SLOPE)
    assert changed_by("mass", 10.0) == pytest.approx(10.0 / (1.0 - LARGEST_SLOPE))
    assert largest == pytest.approx(3.0)
    assert changed_by("brake_gain", 10.0) == 10.0


def fitted(regression: Regression, *, free: bool = True) -> Fit:
    return fit(regression.series, *regression.design(free=free))


def change(found: Fit) -> float:
    return float(found.b[search().parameters.index("brake_gain")])


def test_a_free_parameter_takes_its_size_and_a_held_one_pays_for_it() -> None:
    free, held = (fitted(search(), free=x) for x in (True, False))
    assert change(free) == pytest.approx(WEAKER, abs=0.03)
    assert 0.5 * (change(held) / HELD) ** 2 > 100.0  # nats of its prior


def test_rows_that_are_left_out_do_not_count() -> None:
    rows = np.arange(N) >= N // 2
    e = search().e
    doubled = replace(e, residual=np.where(rows, -e.residual, e.residual))
    both = Regression(doubled, exclude=LIBRARY)
    half = both.without(rows)
    assert half.rows.max() < N // 2
    assert change(fitted(half)) == pytest.approx(WEAKER, abs=0.03)
    assert abs(change(fitted(both))) < 0.1
