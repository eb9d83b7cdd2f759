"""The linear model of the residual, on small drives whose truth is known."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from small_drives import N, evidence

from deeptruck_model.mismatch.mechanisms import LIBRARY
from deeptruck_model.mismatch.posterior.regression import (
    LARGEST_SLOPE,
    Regression,
    changed_by,
)

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


def test_a_free_parameter_takes_its_size_and_a_held_one_pays_for_it() -> None:
    free, held = (search().model((), frozenset(x)) for x in (["brake_gain"], []))
    assert free.moved("brake_gain") == pytest.approx(WEAKER, abs=3.0 * free.moved_sd("brake_gain"))
    assert free.score > held.score + 100.0  # 20 standard deviations of HELD
    assert free.moved_sd("brake_gain") >= 0.5 * WEAKER**2  # what a line may be off by


def test_the_background_frees_what_explains() -> None:
    assert "brake_gain" in search().background(()).free
    assert search(0.0).background(()).free == frozenset()


def test_a_parameter_that_would_leave_what_a_truck_can_have_is_held() -> None:
    model = search(-0.7).model((), frozenset(["brake_gain"]))
    assert model.free == frozenset()
    assert search(-0.4).model((), frozenset(["brake_gain"])).free == {"brake_gain"}


def test_the_bound_is_that_of_the_simulator_as_given() -> None:
    """Brakes that were refitted 30 % weaker before may lose less."""
    before = search(-0.4)
    moved = Regression(replace(before.e, moved={"brake_gain": -0.3}), exclude=LIBRARY)
    assert moved.model((), frozenset(["brake_gain"])).free == frozenset()


def test_rows_that_are_left_out_do_not_count() -> None:
    rows = np.arange(N) >= N // 2
    e = search().e
    doubled = replace(e, residual=np.where(rows, -e.residual, e.residual))
    both = Regression(doubled, exclude=LIBRARY)
    half = both.without(rows)
    free = frozenset(["brake_gain"])
    assert half.rows.max() < N // 2
    assert half.model((), free).moved("brake_gain") == pytest.approx(WEAKER, abs=0.03)
    assert abs(both.model((), free).moved("brake_gain")) < 0.1


def test_a_model_is_fitted_once() -> None:
    assert search().model((), frozenset(["brake_gain"])) is search().model((), frozenset(["brake_gain"]))
