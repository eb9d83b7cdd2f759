"""What is said of the held-out free runs follows from their errors, also where it does not please."""

from __future__ import annotations

from typing import Any

import pytest

from deeptruck_model.mismatch.report import validation


def fit(
    gained: list[float], beside: list[float], *, held_out: int = 1, driven: int = 1, validated: bool = True
) -> dict[str, Any]:
    names = [f"d{k}" for k in range(held_out)]
    errors = {
        name: {"speed_rmse": size}
        for name, size in (("before", 0.9), ("parameters_only", 0.2), ("after", 0.1))
    }
    intervals: dict[str, Any] = {"improvement_ci95": gained, "improvement_over_parameters_ci95": beside}
    intervals["improvement_recordings"] = driven
    chosen = {"chosen": "findings", "validated": validated, "horizon_s": 20.0}
    return {"held_out": names, **chosen, **errors, **intervals}


@pytest.mark.parametrize(
    ("beside", "change", "end"),
    [
        ([0.1, 0.3], "is 10 to 30 % smaller", validation.BETTER.format(what="the findings are")),
        ([-0.74, -0.03], "is 3 to 74 % larger", validation.WORSE),
        ([-0.3, 0.81], "is between 30 % larger and 81 % smaller", validation.EQUAL),
    ],
)
def test_beside_refitted_parameters(beside: list[float], change: str, end: str) -> None:
    said = validation.said(fit([0.95, 0.96], beside))
    assert said[1].startswith("Yes, it is 95 to 96 % smaller (95 % interval over free runs of 20 s)")
    assert change in said[3] and said[4] == end


def test_an_interval_that_rounds_to_one_number_is_said_once() -> None:
    said = validation.said(fit([0.988, 0.991], [-0.2, 0.1]))
    assert said[1].startswith("Yes, it is 99 % smaller (")


def test_a_correction_that_failed_is_not_applied() -> None:
    failed = fit([-0.2, 0.1], [0.0, 0.0], held_out=3, driven=3, validated=False) | {"chosen": "parameters"}
    said = validation.said(failed)
    assert said[1].startswith(
        "No, it is between 20 % larger and 10 % smaller (95 % interval over 3 recordings, in free runs of"
    )
    assert "is not applied" in said[2] and "refitted parameters alone" in said[3]


def test_recordings_that_were_driven_by_fits_to_the_others_are_told() -> None:
    said = validation.said(fit([0.2, 0.6], [0.1, 0.3], held_out=2, driven=8))
    assert "over 8 recordings, each driven by a fit that had not seen it, in free runs of 20 s" in said[1]


def test_what_was_not_changed_may_still_be_worse_than_refitted_parameters() -> None:
    same = fit([0.0, 0.0], [-8.4, -3.6], validated=False) | {"chosen": "nothing"}
    assert validation.said(same)[1] == validation.UNSTATED
    same["improvement_over_parameters_ci95"] = [-0.1, 0.1]
    assert len(validation.said(same)) == 1
    assert validation.said({"validated": False}) == []


@pytest.mark.parametrize(
    ("free", "chosen", "told"), [(0.02, "findings", True), (0.095, "findings", False), (0.02, "laws", False)]
)
def test_that_the_unnamed_would_help_is_told_where_it_is_not_in(free: float, chosen: str, told: bool) -> None:
    driven = fit([0.5, 0.6], [0.1, 0.2]) | {"chosen": chosen, "free_model": {"speed_rmse": free}}
    caveats = validation.caveats(driven, True)
    assert any("--with-unnamed" in c and "0.02 m/s instead of 0.1" in c for c in caveats) == told


def test_why_nothing_may_be_applied_is_told() -> None:
    failed = fit([-0.1, 0.1], [0.1, 0.2], validated=False)
    assert validation.caveats(failed, True) == [validation.NOT_BETTER]
    assert validation.caveats({"validated": False}, True) == [validation.NOT_DRIVEN]


@pytest.mark.parametrize(
    ("before", "tuned", "found", "told"),
    [(0.8, 0.4, False, True), (0.8, 0.6, False, False), (0.06, 0.03, False, False), (0.8, 0.4, True, False)],
)
def test_where_nothing_was_found_and_other_parameters_drive_better_that_is_said(
    before: float, tuned: float, found: bool, told: bool
) -> None:
    errors = {"before": {"speed_rmse": before}, "parameters_only": {"speed_rmse": tuned}}
    driven = fit([0.0, 0.0], [-0.5, -0.2]) | {"chosen": "nothing", "after": errors["before"], **errors}
    said = validation.caveats(driven, found)
    assert any("0.4 m/s instead of 0.8 m/s" in line for line in said) == told
