"""The first sentences say no more than the page below them, in words that are read once."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Any

import pytest
from found_mismatches import fit, mismatch, verdict
from hypothesis import given
from hypothesis import strategies as st

from deeptruck_model.mismatch.correction.worth import SpeedErrors, Worth
from deeptruck_model.mismatch.finding import Kind, Suspicion
from deeptruck_model.mismatch.fit_result import Chosen, Compared, HandedOver, Improvement, Rmse
from deeptruck_model.mismatch.mechanisms import LIBRARY
from deeptruck_model.mismatch.posterior.next_pass import NextPass
from deeptruck_model.mismatch.report import findings, headline, names
from deeptruck_model.mismatch.report.headline import Claim, Headline
from deeptruck_model.mismatch.report.names import Name
from deeptruck_model.mismatch.report.wording import number, percent
from deeptruck_model.mismatch.result import Bound, Conclusion, Regime, SmallestVisible, Verdict

PARAMETERS = tuple(findings.NAMES)
SENSORS = ("acceleration_bias", "speed_scale", "clock_offset", "grade_bias")
MASS = Name("mass", Kind.PARAMETER)
WIND = Name("headwind", Kind.PHYSICS, ("rolling_resistance_speed",))
UNKNOWN = Name("unknown", Kind.PHYSICS)
ERRORS = SpeedErrors(20.0, 1.98, 0.0467, 0.0243)


def corrected(kind: str, **fitted: Any) -> Verdict:
    """A verdict with findings of this kind, and a correction with these values."""
    found = mismatch(kind).result.findings
    return replace(verdict(kind, found), fit=fit(found, **fitted))


def unchanged(tuned: float, before: float = 0.6, always_n: float = 81.0) -> Verdict:
    """A verdict without findings, with speed errors (m/s) and the smallest steady force that is seen (N)."""
    errors = Compared(Rmse(before, 0.1), Rmse(tuned, 0.1), Rmse(before, 0.1))
    found = verdict("nothing_missing", [])
    seen = SmallestVisible({"mass": 1.25}, always_n / 20000.0, 0.045, 20000.0)
    driven = fit([], errors=errors, chosen=Chosen.NOTHING)
    return replace(found, fit=driven, data=replace(found.data, smallest_visible=seen))


def said(*found: Name, **claimed: Any) -> list[str]:
    return headline.sentences(Headline(Claim.FOUND, found, **claimed))


def test_an_undecided_pair_is_named_as_a_pair() -> None:
    (one,) = said(MASS, WIND)
    assert one == (
        "The simulator's mass is off, and it leaves out headwind or rolling resistance that grows with speed."
    )


def test_what_was_decided_stands_alone() -> None:
    assert said(replace(WIND, rivals=())) == ["The simulator leaves out headwind."]
    assert said(MASS) == ["No physics is missing, but the simulator's mass is off."]


def test_a_parameter_that_physics_may_stand_for_is_not_said_alone() -> None:
    drag = Name("drag_area", Kind.PARAMETER, ("headwind", "grade_bias"))
    assert said(drag) == ["The simulator is off in drag area or headwind or grade bias."]
    assert "No physics is missing" in said(replace(drag, rivals=("rolling_resistance",)))[0]


def test_physics_that_a_parameter_may_stand_for_is_not_said_to_be_left_out() -> None:
    assert said(replace(WIND, rivals=("mass",))) == ["The simulator is off in headwind or mass."]


def test_the_first_sentence_says_what_how_large_how_sure_and_what_it_is_worth() -> None:
    wind = replace(WIND, rivals=(), size="300 N while it acts", sure="80 %")
    first, errors, end = said(wind, worth=Worth.AS_GOOD, errors=ERRORS)
    assert first == (
        "The simulator leaves out headwind (300 N while it acts, 80 % sure); corrected, "
        "speed error falls from 1.98 to 0.0243 m/s."
    )
    assert errors == (
        "This is the error of 20 s free runs on held-out recordings; "
        "with all parameters refitted instead it is 0.0467 m/s."
    )
    assert end == "These drives do not tell which of the two predicts better."


def test_a_simulator_without_parameters_is_not_said_to_have_them_refitted() -> None:
    told = said(WIND, worth=Worth.AS_GOOD, errors=ERRORS, scaled=True)
    assert any("with its forces scaled instead it is 0.0467 m/s" in s for s in told)
    assert not any("parameters" in s for s in told)


def test_the_first_of_several_names_keeps_its_size() -> None:
    mass = replace(MASS, size="23000 kg fits", sure="95 %")
    wind = replace(WIND, size="300 N while it acts", sure="40 %")
    first = said(mass, wind, worth=Worth.BETTER, errors=ERRORS)[0]
    assert "mass (23000 kg fits, 95 % sure) is off" in first and "leaves out headwind" in first
    assert first.endswith("corrected, speed error falls from 1.98 to 0.0243 m/s.")


@pytest.mark.parametrize("kind", ["missing_physics", "unknown", "parameter_error"])
def test_size_and_certainty_are_those_of_the_finding(kind: str) -> None:
    (finding,) = mismatch(kind).result.findings
    first = headline.sentences(headline.of(Verdict.read(corrected(kind).to_json())))[0]
    assert f"{percent(finding.probability)} sure)" in first
    assert finding.strength is not None
    size = finding.parameters["mass"].value if kind == "parameter_error" else abs(finding.strength.value)
    assert f"({number(size)} " in first and first.endswith(
        "corrected, speed error falls from 0.6 to 0.1 m/s."
    )


@pytest.mark.parametrize("worth", Worth)
def test_a_gain_is_told_where_it_is_proven(worth: Worth) -> None:
    first, *_ = said(MASS, worth=worth, errors=ERRORS)
    proven = worth not in (Worth.NOT_DRIVEN, Worth.NOT_BETTER)
    assert ("m/s" in first) == proven and ("no correction is proven" in first) != proven


def test_a_force_that_is_not_in_the_correction_is_not_credited() -> None:
    first, out, *_ = said(MASS, UNKNOWN, left_out=(UNKNOWN,), worth=Worth.BETTER, errors=ERRORS)
    assert out == "A force without a name is not in the correction."
    assert "; partly corrected, " in first
    _, stand, *_ = said(WIND, left_out=(WIND,), laws=True, worth=Worth.BETTER, errors=ERRORS)
    assert stand == "Laws stand for headwind in the correction."


def test_no_name_is_credited_where_parameters_alone_went_in() -> None:
    v = corrected("missing_physics", chosen=Chosen.PARAMETERS, corrected=("drag_area", "mass"))
    text = headline.text(v)
    assert headline.PARAMETERS_ALONE in text and "what was found" not in text
    assert "parameters refitted, speed error falls" in text and "corrected," not in text


@pytest.mark.parametrize(
    ("beside", "refitted", "worth"),
    [
        ((0.1, 0.3), 0.4, Worth.BETTER),
        ((0.1, 0.3), 0.05, Worth.AS_GOOD),
        ((-0.8, 0.1), 0.4, Worth.AS_GOOD),
        ((-0.5, -0.1), 0.05, Worth.WORSE),
    ],
)
def test_the_verdict_follows_from_the_interval_and_goes_with_the_errors(
    beside: tuple[float, float], refitted: float, worth: Worth
) -> None:
    told = Compared(Rmse(0.6, 0.05), Rmse(refitted, 0.05), Rmse(0.1, 0.05))
    v = corrected("missing_physics", improvement=Improvement((0.5, 0.8), beside, 1), errors=told)
    assert headline.of(v).worth is worth and headline.text(v).endswith(headline.SHOWN[worth])


def test_what_went_in_is_read_and_not_guessed() -> None:
    assert headline.of(corrected("unknown")).left_out == ()
    left_out = headline.of(corrected("unknown", corrected=())).left_out
    assert [n.effect for n in left_out] == ["unknown"]


def test_a_failed_validation_is_said() -> None:
    v = corrected("missing_physics", validated=False)
    assert "No correction proved better on held-out recordings" in headline.text(v)
    v = corrected("missing_physics", windows=0, validated=False, errors=None, improvement=None)
    assert "No held-out drive is long enough without a gap" in headline.text(v)


def test_a_fault_of_a_sensor_beside_physics_has_its_own_sentence() -> None:
    bias = Name("acceleration_bias", Kind.SENSOR)
    assert said(bias) == ["A sensor is at fault, not the truck model: acceleration bias."]
    assert said(WIND, bias)[1] == "Besides, a sensor is at fault: acceleration bias."


@pytest.mark.parametrize(("newton", "claim"), [(240.0, Claim.AGREES), (1620.0, Claim.MUCH_COULD_HIDE)])
def test_where_much_could_hide_nothing_is_said_to_agree(newton: float, claim: Claim) -> None:
    v = unchanged(0.6, always_n=newton)
    assert headline.of(v).claim is claim and "would have been seen" in headline.text(v)
    told = headline.sentences(headline.of(v))
    assert "Not so mass by 125 %, the most that was tried." in told
    assert "Its free runs of 20 s on held-out recordings are 0.6 m/s off." in told
    seen = replace(
        v, data=replace(v.data, smallest_visible=SmallestVisible({"mass": 0.06}, 0.01, 0.045, None))
    )
    assert "So would mass off by 6 %." in headline.sentences(headline.of(seen))


def test_where_something_differs_without_a_name_the_reason_is_said() -> None:
    v = replace(unchanged(0.1), kind=Conclusion.UNDETERMINED, caveats=("two drives", "it is off by much"))
    assert headline.sentences(headline.of(v)) == ["No cause can be named.", "It is off by much."]
    nothing_driven = replace(v, fit=None)
    assert headline.text(nothing_driven) == "Nothing can be said yet. It is off by much."


EFFECTS = st.sampled_from((*LIBRARY, *PARAMETERS, *SENSORS, "unknown"))
NAMES = st.builds(
    Name,
    EFFECTS,
    st.sampled_from(Kind),
    st.lists(EFFECTS, max_size=8).map(tuple),
    st.sampled_from(("", "12300 N while it acts", "1.05 of the simulator's fits")),
    st.sampled_from(("", "80 %", "above 99 %")),
)
FOUND = st.lists(NAMES, min_size=1, max_size=7).map(tuple)
SIZES = st.floats(1e-4, 99.0)


@given(
    st.builds(
        Headline,
        claim=st.just(Claim.FOUND),
        found=FOUND,
        left_out=FOUND | st.just(()),
        laws=st.booleans(),
        worth=st.sampled_from(Worth),
        errors=st.builds(SpeedErrors, st.floats(10.0, 20.0), SIZES, SIZES, SIZES),
    )
)
def test_whatever_was_found_no_sentence_is_long(h: Headline) -> None:
    for sentence in headline.sentences(h):
        assert len(sentence.split()) <= names.LONGEST and sentence.endswith(".")
        assert sentence[0].isupper() and "_" not in sentence
        assert not re.search(r"\([^)]*\(", sentence)


@pytest.mark.parametrize(("low", "told"), [(0.5, True), (-0.1, False)])
def test_a_road_that_another_pass_shows_is_said(low: float, told: bool) -> None:
    again = NextPass(28.0, 0.112, 0.0414, (low, 0.78))
    sentences = headline.sentences(headline.of(corrected("missing_physics", next_pass=again)))
    assert any("on 28 km ahead it leaves 0.0414 of 0.112 m/s²" in s for s in sentences) == told


def test_parameters_that_the_correction_moves_beside_what_was_found_are_said() -> None:
    moved = {"drag_area": -0.212, "mass": 0.001}
    sentences = headline.sentences(headline.of(corrected("missing_physics", refitted=moved)))
    assert "Besides what was found, the correction moves drag area by -21 %." in sentences


def test_that_a_correction_holds_the_mean_of_a_force_alone_is_said() -> None:
    sentences = headline.sentences(headline.of(corrected("missing_physics", by_mean=("road_surface",))))
    assert headline.BY_MEAN.format("road surface") in sentences


def test_what_a_correction_is_worth_where_nobody_tells_it_its_place_is_said() -> None:
    alone = HandedOver(("place", "gap"), 0.59)
    sentences = headline.sentences(headline.of(corrected("missing_physics", handed_over=alone)))
    assert any("Where nobody tells it the place and the gap" in s for s in sentences)
    assert any("this error is 0.59 m/s" in s for s in sentences)
    refused = headline.of(corrected("missing_physics", handed_over=alone, validated=False))
    assert not any("Where nobody tells it" in s for s in headline.sentences(refused))


def test_a_name_that_the_correction_holds_instead_of_what_was_found_is_said() -> None:
    held = corrected("missing_physics", corrected=("driveline_loss",))
    sentences = headline.sentences(headline.of(held))
    assert "It holds driveline loss instead, which comes near to it and is no finding." in sentences
    assert not [s for s in headline.sentences(headline.of(corrected("missing_physics"))) if "instead, " in s]


def test_where_most_of_what_is_left_is_is_said() -> None:
    pulls = (Bound("acceleration over 2 s", 0.5, float("inf"), "m/s²"),)
    silent = unchanged(0.6)
    v = replace(silent, regimes=(Regime(pulls, 0.55, 0.026), Regime((), 0.45, 0.974)))
    told = "Of its error 55 % is in 3 % of the time, where acceleration over 2 s > 0.5 m/s²."
    assert told in headline.sentences(headline.of(v))
    even = replace(silent, regimes=(Regime(pulls, 0.1, 0.026), Regime((), 0.9, 0.974)))
    assert not [s for s in headline.sentences(headline.of(even)) if "Of its error" in s]


def test_a_rare_force_that_would_have_been_seen_is_said() -> None:
    (first, *_) = headline.sentences(headline.of(unchanged(0.6)))
    assert first.endswith("a steady force above 81 N, or 900 N for 2 % of the time, would have been seen.")
    (first, *_) = headline.sentences(headline.of(unchanged(0.6, always_n=1000.0)))
    assert "for 2 % of the time" not in first


def test_what_is_suspected_and_too_little_is_said_beside_nothing() -> None:
    silent = unchanged(0.6)
    suspected = replace(silent, suspicions=(Suspicion("command_rate_limit", 30.4, "step the commands"),))
    last = headline.sentences(headline.of(suspected))[-1]
    assert last == "Suspected, and too little to be noticed: limited rate of the commands."
    assert not [s for s in headline.sentences(headline.of(silent)) if "uspected" in s]
