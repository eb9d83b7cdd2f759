"""A learned simulator that drives clearly worse here than on its own truck's drives is not called right."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from deeptruck_model import driving_cycles, trucks
from deeptruck_model.mismatch.correction.own_error import differs, speed_error
from deeptruck_model.mismatch.fit_result import Chosen, Compared, FitResult, Improvement, Rmse
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
