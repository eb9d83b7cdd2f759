"""What is said of the held-out free runs follows from their errors, also where it does not please."""

from __future__ import annotations

from typing import Any

import pytest
from found_mismatches import mismatch, verdict

from deeptruck_model.mismatch import page_text, validation_words


def fit(
    gained: list[float], beside: list[float], *, held_out: int = 1, driven: int = 1, validated: bool = True
) -> dict[str, Any]:
    names = [f"d{k}" for k in range(held_out)]
    errors = {name: {"speed_rmse": size} for name, size in (("before", 0.9), ("after", 0.1))}
    intervals: dict[str, Any] = {"improvement_ci95": gained, "improvement_over_parameters_ci95": beside}
    intervals["improvement_recordings"] = driven
    return {"held_out": names, "validated": validated, "improvement_horizon_s": 20.0, **errors, **intervals}


@pytest.mark.parametrize(
    ("beside", "change", "end"),
    [
        ([0.1, 0.3], "is 10 to 30 % smaller", validation_words.BETTER.format(what="the findings are")),
        ([-0.74, -0.03], "is 3 to 74 % larger", validation_words.WORSE),
        ([-0.3, 0.81], "is between 30 % larger and 81 % smaller", validation_words.EQUAL),
    ],
)
def test_beside_refitted_parameters(beside: list[float], change: str, end: str) -> None:
    said = validation_words.said(fit([0.95, 0.96], beside))
    assert said[1].startswith("Yes, it is 95 to 96 % smaller (95 % interval over free runs of 20 s)")
    assert change in said[2] and said[2].endswith(end)


def test_an_interval_that_rounds_to_one_number_is_said_once() -> None:
    said = validation_words.said(fit([0.988, 0.991], [-0.2, 0.1]))
    assert said[1].startswith("Yes, it is 99 % smaller (")


@pytest.mark.parametrize(("tuned", "agrees"), [(0.005, False), (0.25, True)])
def test_a_simulator_that_other_parameters_mend_does_not_agree(tuned: float, agrees: bool) -> None:
    """'the simulator agrees' had stood beside a refit that drove 55 times better."""
    errors = {"before": {"speed_rmse": 0.257}, "parameters_only": {"speed_rmse": tuned}}
    said = page_text.sentence(verdict("nothing_missing", []) | {"fit": errors})
    assert ("the simulator agrees" in said) == agrees
    assert ("the simulator is off" in said) != agrees


def test_a_correction_that_failed_is_not_applied() -> None:
    said = validation_words.said(fit([-0.2, 0.1], [0.0, 0.0], held_out=3, driven=3, validated=False))
    assert said[1].startswith(
        "No, it is between 20 % larger and 10 % smaller (95 % interval over 3 recordings, in free runs of"
    )
    assert "is not applied" in said[1] and "refitted parameters alone" in said[2]


def test_recordings_that_were_driven_by_fits_to_the_others_are_told() -> None:
    said = validation_words.said(fit([0.2, 0.6], [0.1, 0.3], held_out=2, driven=8))
    assert "over 8 recordings, each driven by a fit that had not seen it, in free runs of 20 s" in said[1]


def test_what_was_not_changed_may_still_be_worse_than_refitted_parameters() -> None:
    same = fit([0.0, 0.0], [-8.4, -3.6], validated=False)
    same["after"] = same["before"]
    assert validation_words.said(same)[1] == validation_words.UNSTATED
    same["improvement_over_parameters_ci95"] = [-0.1, 0.1]
    assert len(validation_words.said(same)) == 1
    assert validation_words.said({"validated": False}) == []


@pytest.mark.parametrize("beside", [[-0.5, -0.1], [-0.8, 0.1]])
def test_the_first_sentence_owns_up(beside: list[float]) -> None:
    v = verdict("missing_physics", mismatch("missing_physics").findings)
    assert "where refitted parameters alone" not in page_text.sentence(v)
    v["fit"] |= {"improvement_over_parameters_ci95": beside, "parameters_only": {"speed_rmse": 0.05}}
    assert page_text.sentence(v).endswith("to 0.1 m/s, where refitted parameters alone reach 0.05.")


def test_no_name_is_credited_where_parameters_alone_went_in() -> None:
    v = verdict("missing_physics", mismatch("missing_physics").findings)
    assert "corrected, the speed error" in page_text.sentence(v)
    v["fit"] |= {"improvement_over_parameters_ci95": [0.0, 0.0]}
    assert "; with its parameters alone refitted, the speed error" in page_text.sentence(v)


@pytest.mark.parametrize(
    ("free", "asked", "told"), [(0.2, False, True), (0.48, False, False), (0.2, True, False)]
)
def test_that_the_unnamed_would_help_is_told_to_whoever_did_not_ask(
    free: float, asked: bool, told: bool
) -> None:
    fit = {"validated": True, "after": {"speed_rmse": 0.5}, "free_model": {"speed_rmse": free}}
    caveats = validation_words.caveats(fit, True, asked)
    assert any("--with-unnamed" in c and "0.2 m/s instead of 0.5" in c for c in caveats) == told
    assert validation_words.caveats({"validated": False, "windows": 5}, True, asked) == [
        validation_words.NOT_BETTER
    ]
    assert validation_words.caveats({"validated": False, "windows": 0}, True, asked) == [
        validation_words.NOT_DRIVEN
    ]


@pytest.mark.parametrize(
    ("before", "tuned", "found", "told"),
    [(0.8, 0.4, False, True), (0.8, 0.6, False, False), (0.12, 0.06, False, False), (0.8, 0.4, True, False)],
)
def test_where_nothing_was_found_and_other_parameters_drive_better_that_is_said(
    before: float, tuned: float, found: bool, told: bool
) -> None:
    errors = {"before": {"speed_rmse": before}, "parameters_only": {"speed_rmse": tuned}}
    said = validation_words.caveats({"validated": True, "after": errors["before"], **errors}, found, False)
    assert any("0.4 m/s instead of 0.8 m/s" in line for line in said) == told
