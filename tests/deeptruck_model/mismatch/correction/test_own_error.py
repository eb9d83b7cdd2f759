"""A learned simulator that drives clearly worse here than on its own truck's drives is not called right."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from deeptruck_model import driving_cycles, trucks
from deeptruck_model.mismatch.correction.own_error import acts_there_alone, differs, off_for_long, speed_error
from deeptruck_model.mismatch.fit_result import Chosen, Compared, FitResult, Improvement, Rmse
from deeptruck_model.mismatch.posterior.search import Search
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.result import Bound, Regime
from deeptruck_model.mismatch.rules import Rules

TRUCK = trucks.load("trucksim")
HILLS = Regime((Bound("grade", 0.02, np.inf, ""),), 0.7, 0.2)
HORIZON_S = 20.0


class Learned:
    """As a learned truck: it keeps recordings, of a truck that is 10 % heavier, and tells no parameters."""

    def __init__(self) -> None:
        heavier = TRUCK.with_parameters({"mass": 1.1 * TRUCK.parameters()["mass"]})
        self.reference = (driving_cycles.drive(heavier, seconds=180.0, seed=1),)

    def parameters(self) -> dict[str, float]:
        return {}

    def __getattr__(self, name: str) -> Any:
        return getattr(TRUCK, name)


def fit(speed_error: float) -> FitResult:
    as_given = Rmse(speed_error, 0.1)
    return FitResult(
        ("held",), HORIZON_S, 12, Chosen.NOTHING, (), False,
        Compared(as_given, as_given, as_given), Improvement((0.0, 0.0), (0.0, 0.0), 1),
    )  # fmt: skip


@pytest.fixture(scope="module")
def own() -> float:
    error = speed_error(Learned(), False, HORIZON_S)  # type: ignore[arg-type]
    assert error is not None and error > 0.05
    return error


def said(here: float, simulator: Any) -> str:
    return differs(simulator, False, fit(here), [HILLS], Rules())


def test_it_says_by_how_much_and_where(own: float) -> None:
    text = said(1.5 * own, Learned())
    assert f"{1.5 * own:.2g} m/s off in free runs of 20 s" in text and f"{own:.2g} m/s on drives" in text
    assert HILLS.where in text


def test_what_drives_as_it_did_on_its_own_drives_does_not_differ(own: float) -> None:
    assert said(1.2 * own, Learned()) == ""


def test_nothing_is_said_without_drives_of_its_own_or_without_free_runs(own: float) -> None:
    assert said(9.0, TRUCK) == ""
    undriven = replace(fit(0.0), errors=None)
    assert differs(Learned(), False, undriven, [], Rules()) == ""  # type: ignore[arg-type]


def alone(e: Evidence, fitted: float, held_out: float) -> str:
    """What is said where drives are so much off (m/s^2) that were fitted and held out."""
    off = np.where(e.held_out, held_out, fitted)
    search = Search(e)
    return acts_there_alone(replace(e, residual=e.residual + off), search.model((), frozenset()))


def test_what_acts_on_a_held_out_drive_alone_is_told_by_its_name(nothing_missing: Evidence) -> None:
    """A fan that ran on the held-out drive alone was 'nothing is missing', at 0.86 m/s."""
    assert "along 'b', which was held out" in alone(nothing_missing, 0.0, 0.06)


def test_a_drive_like_those_fitted_is_no_news(nothing_missing: Evidence) -> None:
    assert alone(nothing_missing, 0.0, 0.0) == alone(nothing_missing, 0.06, 0.06) == ""
    assert alone(nothing_missing, 0.06, 0.0) == ""


def test_without_a_held_out_drive_nothing_is_said_of_one(nothing_missing: Evidence) -> None:
    fitted = tuple(replace(s, held_out=False) for s in nothing_missing.stretches)
    assert alone(replace(nothing_missing, stretches=fitted), 0.0, 0.06) == ""


def for_long(e: Evidence, off: float, times: int) -> str:
    """What is said where drives are so much off (m/s^2) for ten seconds, so many times."""
    elapsed = np.arange(len(e)) * e.dt
    residual = e.residual + np.where((elapsed % 100.0 < 10.0) & (elapsed < 100.0 * times), off, 0.0)
    return off_for_long(replace(e, residual=residual), Search(e).model((), frozenset()), [HILLS])


def test_a_simulator_that_is_far_off_now_and_then_is_not_right(nothing_missing: Evidence) -> None:
    """A motor that derates for ten seconds at a time was 'nothing is missing', at 0.45 m/s."""
    text = for_long(nothing_missing, -0.1, 8)
    assert "0.11 m/s^2 off in the mean over 10 s, in 8 of 120 such times" in text and HILLS.where in text


@pytest.mark.parametrize(("off", "times"), [(0.0, 0), (-0.1, 2), (0.03, 12)])
def test_slow_noise_and_rare_exceptions_are_no_news(
    nothing_missing: Evidence, off: float, times: int
) -> None:
    assert for_long(nothing_missing, off, times) == ""


def test_of_a_learned_simulator_its_own_drives_tell(nothing_missing: Evidence) -> None:
    learned = replace(nothing_missing, itself=nothing_missing)
    assert for_long(learned, -0.1, 8) == ""
