"""What is said of the held-out free runs follows from their errors, also where it does not please."""

from __future__ import annotations

from dataclasses import replace

import pytest

from deeptruck_model.mismatch.fit_result import (
    Chosen,
    Compared,
    FitResult,
    HandedOver,
    Improvement,
    Interval,
    Rmse,
)
from deeptruck_model.mismatch.posterior.next_pass import NextPass
from deeptruck_model.mismatch.report import validation

NOT_DRIVEN = FitResult((), 20.0, 0, Chosen.FINDINGS, ("mass",), False)


def errors(before: float, tuned: float, after: float, free: float | None = None) -> Compared:
    """By speed errors, m/s."""
    free_model = None if free is None else Rmse(free, 0.1)
    return Compared(Rmse(before, 0.1), Rmse(tuned, 0.1), Rmse(after, 0.1), free_model)


def fit(
    gained: Interval,
    beside: Interval,
    *,
    held_out: int = 1,
    driven: int = 1,
    validated: bool = True,
    chosen: Chosen = Chosen.FINDINGS,
    refitted: float = 0.2,
) -> FitResult:
    names = tuple(f"d{k}" for k in range(held_out))
    improvement = Improvement(gained, beside, driven)
    return FitResult(names, 20.0, 4, chosen, ("mass",), validated, errors(0.9, refitted, 0.1), improvement)


@pytest.mark.parametrize(
    ("beside", "refitted", "change", "end"),
    [
        ((0.1, 0.3), 0.2, "is 10 to 30 % smaller", validation.BETTER.format(what="the findings are")),
        ((0.1, 0.3), 0.09, "is 10 to 30 % smaller", validation.EQUAL),
        ((-0.74, -0.03), 0.09, "is 3 to 74 % larger", validation.WORSE),
        ((-0.74, -0.03), 0.2, "is 3 to 74 % larger", validation.EQUAL),
        ((-0.3, 0.81), 0.2, "is between 30 % larger and 81 % smaller", validation.EQUAL),
    ],
)
def test_beside_refitted_parameters(beside: Interval, refitted: float, change: str, end: str) -> None:
    """Surely so, and not against the errors that are told of the held-out drives."""
    said = validation.said(fit((0.95, 0.96), beside, refitted=refitted))
    assert said[1].startswith("Yes, it is 95 to 96 % smaller (95 % interval over free runs of 20 s)")
    assert change in said[3] and said[4] == end


def test_a_correction_that_changes_nothing_of_what_is_held_out_is_not_applied() -> None:
    """The other recordings speak for it; those that are held out do not tell where they are, say."""
    still = replace(fit((0.3, 0.8), (0.1, 0.3), driven=8, validated=False), errors=errors(0.9, 0.2, 0.9))
    said = validation.said(still)
    assert said[1].startswith("It is 30 to 80 % smaller (95 % interval over 8 recordings")
    assert said[2:4] == [f"But {validation.STILL}.", validation.REFUSED]
    assert validation.caveats(still, True)[0].startswith(validation.STILL)


def test_what_is_each_drives_own_is_told_so_where_its_mean_is_no_correction() -> None:
    nothing = fit((0.0, 0.0), (-0.1, 0.1), validated=False, chosen=Chosen.NOTHING)
    assert validation.caveats(nothing, True, of_these_drives=True) == [validation.EACH_ITS_OWN]
    assert validation.caveats(nothing, True) == [validation.UNCHANGED]


def test_an_interval_that_rounds_to_one_number_is_said_once() -> None:
    said = validation.said(fit((0.988, 0.991), (-0.2, 0.1)))
    assert said[1].startswith("Yes, it is 99 % smaller (")


def test_a_correction_that_failed_is_not_applied() -> None:
    alone = Chosen.PARAMETERS
    failed = fit((-0.2, 0.1), (0.0, 0.0), held_out=3, driven=3, validated=False, chosen=alone)
    said = validation.said(failed)
    assert said[1].startswith(
        "No, it is between 20 % larger and 10 % smaller (95 % interval over 3 recordings, in free runs of"
    )
    assert "is not applied" in said[2] and "refitted parameters alone" in said[3]


def test_recordings_that_were_driven_by_fits_to_the_others_are_told() -> None:
    said = validation.said(fit((0.2, 0.6), (0.1, 0.3), held_out=2, driven=8))
    assert "over 8 recordings, each driven by a fit that had not seen it, in free runs of 20 s" in said[1]


def test_what_was_not_changed_may_still_be_worse_than_refitted_parameters() -> None:
    worse, unsure = (
        fit((0.0, 0.0), beside, validated=False, chosen=Chosen.NOTHING)
        for beside in ((-8.4, -3.6), (-0.1, 0.1))
    )
    assert validation.said(worse)[1] == validation.UNSTATED
    assert len(validation.said(unsure)) == 1
    assert validation.said(NOT_DRIVEN) == validation.said(None) == []


@pytest.mark.parametrize(
    ("free", "chosen", "told"),
    [(0.02, Chosen.FINDINGS, True), (0.095, Chosen.FINDINGS, False), (0.02, Chosen.LAWS, False)],
)
def test_that_the_unnamed_would_help_is_told_where_it_is_not_in(
    free: float, chosen: Chosen, told: bool
) -> None:
    driven = fit((0.5, 0.6), (0.1, 0.2), chosen=chosen)
    caveats = validation.caveats(replace(driven, errors=errors(0.9, 0.2, 0.1, free)), True)
    assert any("--with-unnamed" in c and "0.02 m/s instead of 0.1" in c for c in caveats) == told


def test_why_nothing_may_be_applied_is_told() -> None:
    failed = fit((-0.1, 0.1), (0.1, 0.2), validated=False)
    assert validation.caveats(failed, True) == [validation.NOT_BETTER]
    assert validation.caveats(NOT_DRIVEN, True) == [validation.NOT_DRIVEN]


@pytest.mark.parametrize(
    ("before", "tuned", "often", "says"),
    [
        (0.8, 0.4, 0.0, "0.4 m/s instead of 0.8 m/s"),
        (0.8, 0.6, 0.0, ""),
        (0.06, 0.03, 0.0, ""),
        (0.8, 0.6, 0.34, "in 34 % of the fitted driving"),
    ],
)
def test_a_simulator_that_is_off_without_a_name_is_not_said_to_agree(
    before: float, tuned: float, often: float, says: str
) -> None:
    driven = fit((0.0, 0.0), (-0.5, -0.2), chosen=Chosen.NOTHING)
    said = validation.off_without_a_name(replace(driven, errors=errors(before, tuned, before)), often)
    assert says in said and bool(says) == bool(said)


def test_by_how_much_other_parameters_must_help_goes_with_the_length_of_the_runs() -> None:
    """A steady acceleration makes twice the speed error in runs twice as long."""
    driven = replace(fit((0.0, 0.0), (-0.5, -0.2), chosen=Chosen.NOTHING), errors=errors(0.16, 0.08, 0.16))
    for horizon_s, noticed in ((20.0, True), (40.0, False)):
        assert bool(validation.off_without_a_name(replace(driven, horizon_s=horizon_s), 0.0)) == noticed


def test_where_something_was_withdrawn_nothing_missing_is_no_answer() -> None:
    said = validation.no_name_is_sure(["accessory_load", "accessory_load", "headwind"])
    assert said.startswith("accessory load or headwind explained the fitted recordings")
    assert validation.no_name_is_sure([]) == ""


def test_a_correction_that_harms_where_nobody_tells_it_the_gap_is_refused_and_says_so() -> None:
    good = fit((0.95, 0.96), (0.1, 0.3))
    for after, harms in ((0.91, False), (1.4, True)):
        alone = replace(good, handed_over=HandedOver(("gap",), after), validated=not harms)
        assert alone.harms_alone == harms and FitResult.read(alone.to_json()) == alone
        told = "where nobody tells it the gap, the corrected simulator predicts held-out recordings worse"
        assert any(told in line for line in validation.said(alone)) == harms
        assert any(told in line for line in validation.caveats(alone, found=True)) == harms


def test_that_the_correction_has_other_sizes_is_said_and_kept() -> None:
    usual = fit((0.95, 0.96), (0.1, 0.3))
    driving = replace(usual, for_driving=True)
    assert validation.FOR_DRIVING in validation.said(driving) and driving.to_json()["for_driving"]
    assert validation.FOR_DRIVING not in validation.said(usual) and "for_driving" not in usual.to_json()
    assert FitResult.read(driving.to_json()) == driving


def test_by_how_much_parameters_are_moved_is_said_and_kept() -> None:
    moved = replace(fit((0.95, 0.96), (0.1, 0.3)), refitted={"rolling_resistance": -0.11, "brake_gain": 0.24})
    assert validation.said(moved)[-1].endswith(": brake gain +24.0 %, rolling resistance -11.0 %.")
    read = FitResult.read(moved.to_json())
    assert read is not None and read.refitted == moved.refitted
    assert "refitted" not in fit((0.95, 0.96), (0.1, 0.3)).to_json()


@pytest.mark.parametrize(("low", "says"), [(0.3, "is shown by another pass"), (-0.1, "is not shown")])
def test_what_one_pass_over_a_road_is_worth_on_another_is_said(low: float, says: str) -> None:
    again = NextPass(12.0, 0.21, 0.09, (low, 0.7))
    driven = replace(fit((0.0, 0.0), (0.0, 0.0), chosen=Chosen.NOTHING), next_pass=again)
    assert any("leaves 0.09 of 0.21 m/s^2" in line and says in line for line in validation.said(driven))
    assert validation.said(replace(NOT_DRIVEN, next_pass=again))
    read = FitResult.read(driven.to_json())
    assert read is not None and read.next_pass == again


def test_where_nothing_went_in_no_corrected_simulator_is_blamed() -> None:
    unchanged = fit((0.0, 0.0), (0.0, 0.0), validated=False, chosen=Chosen.NOTHING)
    assert validation.caveats(unchanged, True) == [validation.UNCHANGED]
    assert validation.caveats(replace(unchanged, chosen=Chosen.FINDINGS), True) == [validation.NOT_BETTER]
