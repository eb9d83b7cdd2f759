"""Sentences of a verdict that was made by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from deeptruck_core.signals import shown
from deeptruck_model.mismatch.correction.fit_result import (
    FitResult,
    FreeRunErrors,
    Improvement,
    Refitted,
    Rmse,
    Strength,
)
from deeptruck_model.mismatch.folders import AS_GIVEN, CORRECTION, NOT_SIGNIFICANT, REFIT
from deeptruck_model.mismatch.output import summary
from deeptruck_model.mismatch.posterior.budget import Budget, Part
from deeptruck_model.mismatch.posterior.events import Event, Possible
from deeptruck_model.mismatch.prepare.sensors import SensorFault
from deeptruck_model.mismatch.report import lines, page
from deeptruck_model.mismatch.report.found import Mismatch
from deeptruck_model.mismatch.verdict import wording
from deeptruck_model.mismatch.verdict.findings import of_fault
from deeptruck_model.mismatch.verdict.result import (
    Advice,
    Alternative,
    Answer,
    Bound,
    Conclusion,
    Data,
    Finding,
    Kind,
    Size,
    Verdict,
)
from deeptruck_model.mismatch.verdict.wording import opened

PAYLOAD = Finding(
    Kind.PHYSICS, "payload_change", "load", "payload_change", "the mass changed", "m -> m + dm", {},
    "accelerate before and after", ("recording", "time"), 0.93, 0.95,
)  # fmt: skip


def driven(low: float, high: float) -> Verdict:
    change = Improvement((low, high), (low, high), 1)
    fit = FitResult(("a",), 40.0, 3, ("headwind",), improvement=change)
    return Verdict(Conclusion.PHYSICS, (PAYLOAD,), fit=fit)


@pytest.mark.parametrize(
    ("low", "high", "says"),
    [
        (0.2, 0.5, "falls by 20 to 50 %"),
        (-3.87, 0.45, "is between 45 % lower and 387 % higher"),
        (-0.4, -0.1, "rises by 10 to 40 %"),
    ],
)
def test_a_change_of_the_error_is_said_with_its_direction(low: float, high: float, says: str) -> None:
    assert f"1 held-out drive. There the mean error {says} (95 % interval)" in page.errors_say(
        driven(low, high)
    )


def test_no_significant_change_is_said_as_apply_says_it() -> None:
    assert f": {NOT_SIGNIFICANT}; not validated." in page.errors_say(driven(-0.4, 0.1))
    for low, high in ((0.2, 0.5), (-0.4, -0.1)):
        assert NOT_SIGNIFICANT not in page.errors_say(driven(low, high))


def test_sizes_follow_the_first_line() -> None:
    """The change of a parameter in its unit, a fitted size, the force; of a curve the force alone."""
    error = {"mass": Size(24000.0, "kg", (22000.0, 26000.0)), "relative_error": Size(0.2, "1", (0.1, 0.3))}
    mass = replace(PAYLOAD, kind=Kind.PARAMETER, effect="mass", stated="mass", parameters=error)
    acting = Strength(-699.4, "N", one_way=True, share_of_time=0.82, ci95=(-790.0, -610.0))
    wind = replace(
        PAYLOAD, effect="headwind", stated="air_tyres_road", strength=acting,
        parameters={"wind": Size(4.37, "m/s", (0.43, 8.31))},
    )  # fmt: skip
    curve = replace(wind, parameters={"share_0_to_0.3_s": Size(0.2, "1", (0.1, 0.3))}, stated="headwind")
    first, second, *_ = lines.lines(Verdict(Conclusion.PARAMETER, (mass, wind, curve)))
    assert first.startswith("Mass of the simulator is wrong")
    assert second == (
        "Most probable sizes (95 % intervals in brackets): mass: +4,000 kg (+2,000 to +6,000), +20 % (+10 to "
        "+30); if headwind: wind 4.37 m/s (0.43 to 8.31), mean -699 N (-790 to -610) while it acts, 82 % of "
        "the time; headwind: mean -699 N (-790 to -610) while it acts, 82 % of the time."
    )
    plain = replace(curve, strength=replace(acting, ci95=None))
    assert lines.sizes(Verdict(Conclusion.PHYSICS, (plain,))).startswith("Most probable sizes: ")
    assert lines.sizes(Verdict(Conclusion.NOTHING)) == ""


def test_parameters_that_are_wrong_together_are_the_first_line() -> None:
    """Where no single name is stated and the correction adds no force."""
    fit = FitResult(
        ("d",), 40.0, 3, ("mass", "drag_area"), validated=True, offered=CORRECTION,
        corrected_parameters={"mass": 0.101, "drag_area": 0.19, "torque_gain": 0.002},
    )  # fmt: skip
    v = Verdict(Conclusion.UNDETERMINED, fit=fit)
    assert lines.headline(v) == (
        "Mass (+10 %) and drag area (+19 %) are wrong together: apply the correction"
    )
    wind = {"headwind": Strength(-310.0, "N", one_way=True, share_of_time=0.8)}
    assert "together" not in lines.headline(replace(v, fit=replace(fit, corrected_forces=wind)))
    stated = replace(PAYLOAD, kind=Kind.PARAMETER, effect="mass", stated="mass")
    assert "together" not in lines.headline(replace(v, kind=Conclusion.PARAMETER, findings=(stated,)))


def test_a_parameter_that_hardly_matters_is_said_with_what_it_makes_at_high_speed() -> None:
    error = Size(0.27, "1", (0.06, 0.47))
    drag = replace(
        PAYLOAD, kind=Kind.PARAMETER, effect="drag_area", stated="mismatch", probability=0.68,
        parameters={"relative_error": error},
    )  # fmt: skip
    fit = FitResult(("a",), 40.0, 3, (), at_high_speed={"drag_area": -3.0})
    good = {"simulator": Advice(Answer.YES, "off by 0.1 m/s")}
    v = Verdict(Conclusion.NOTHING, (drag,), fit=fit, advice=good)
    assert lines.headline(v) == (
        "The simulator is good enough for such drives, although drag area may be wrong (68 %)"
    )
    assert list(lines.what_to_do(v)) == [
        "Use the simulator as it is for such drives. Its drag area may be off by +27 % (+6 to +47); on a "
        "level road at 25 m/s that adds up to -0.81 m/s (-1.41 to -0.18) after 40 s: check it before such "
        "drives."
    ]


def test_a_load_of_each_drive_is_advised_as_the_mass_to_set() -> None:
    loads = replace(PAYLOAD, mass_by_drive={"monday": 24310.4, "tuesday": 19800.0})
    v = Verdict(Conclusion.PHYSICS, (loads,))
    assert lines.headline(v).endswith(": set the mass of each drive")
    (says,) = lines.what_to_do(v)
    assert says == 'Set the simulator\'s mass for each drive, kg: {"monday": 24310, "tuesday": 19800}.'
    (says,) = lines.what_to_do(replace(v, findings=(replace(loads, stated="load"),)))
    assert says.startswith("If it is payload change, set the simulator's mass for each drive")


def test_a_fault_is_said_as_what_is_wrong_and_is_to_be_repaired() -> None:
    turned = SensorFault("acceleration_bias", -1.0, 0.0, "1", "the accelerometer has the wrong sign")
    v = Verdict(Conclusion.SENSOR, (of_fault(turned),))
    assert lines.headline(v) == "The accelerometer has the wrong sign: repair the sensor"
    (step,) = lines.what_to_do(v)
    assert step.endswith("before you record more: the accelerometer has the wrong sign.")


@pytest.mark.parametrize("offered", [AS_GIVEN, REFIT, CORRECTION])
def test_one_set_of_parameters_is_said(offered: str) -> None:
    """Those refitted alone, or those that the offered correction changes."""
    errors = FreeRunErrors(Rmse(0.8, 0.1), Rmse(0.6, 0.1), Rmse(0.4, 0.1))
    fit = FitResult(
        ("d",), 40.0, 3, ("headwind", "mass"), validated=offered != AS_GIVEN, errors=errors,
        corrected_parameters={"mass": 0.32}, offered=offered, refit={"mass": Refitted(0.168, (0.08, 0.26))},
    )  # fmt: skip
    said = " ".join(lines.lines(Verdict(Conclusion.PHYSICS, (PAYLOAD,), fit=fit)))
    assert ("mass +17 % (+8 to +26)" in said) is (offered != CORRECTION)
    assert ("mass +32 %" in said) is (offered == CORRECTION)
    assert "refitted alone 0.6" in said


def test_the_parts_of_the_correction_are_said_and_whether_the_name_above_is_one() -> None:
    force = {"headwind": Strength(-310.0, "N", one_way=True, share_of_time=0.8)}
    fit = FitResult(
        ("d",), 40.0, 3, ("headwind", "mass"), validated=True, offered=CORRECTION,
        corrected_parameters={"mass": 0.32, "drag_area": 0.001}, corrected_forces=force,
    )  # fmt: skip
    v = Verdict(Conclusion.PHYSICS, (PAYLOAD,), fit=fit)
    parts = "The correction contains: mass +32 %; headwind mean -310 N while it acts, 80 % of the time."
    first, *said = lines.lines(v)
    assert first.startswith("Payload change is missing") and said[0] == parts
    assert said[1].startswith("It does not contain payload change, which the first line names")
    for stated in ("payload_change", "load"):
        f = replace(PAYLOAD, stated=stated)
        own = replace(
            v, findings=(f,), fit=replace(fit, corrected_forces={"payload_change": force["headwind"]})
        )
        assert not any("does not contain" in line for line in lines.lines(own))
    assert list(lines.contains(replace(v, fit=replace(fit, offered=AS_GIVEN)))) == []
    assert "contains" not in str(list(lines.contains(v, refit=True)))


def test_what_is_offered_is_said_where_nothing_is_missing() -> None:
    fit = FitResult(("d",), 40.0, 3, (), validated=True, offered=REFIT)
    v = Verdict(Conclusion.NOTHING, fit=fit)
    assert lines.headline(v) == "Nothing that matters is missing: apply the refitted parameters"
    (step,) = lines.what_to_do(v)
    assert step.startswith("Apply the refitted parameters alone")
    sensor = replace(PAYLOAD, kind=Kind.SENSOR)
    assert list(lines.what_to_do(replace(v, findings=(sensor,))))[-1].startswith("Then apply the refitted")


def test_a_doubtful_input_comes_before_everything_that_was_found_with_it() -> None:
    fit = FitResult(("d",), 40.0, 3, (), validated=True, offered=REFIT)
    for kind in (Conclusion.PHYSICS, Conclusion.NOTHING):
        v = Verdict(kind, (PAYLOAD,), fit=fit, data=Data(doubts=("are the two swapped?",)))
        first, second, *rest = lines.lines(v)
        assert first.endswith("settle the doubtful input.")
        assert second == "Doubtful input: are the two swapped?"
        assert "Settle the doubtful input and compare again; apply nothing before." in rest
        assert not any(line.startswith("Apply ") for line in rest)


def test_a_sensor_that_is_only_most_probable_is_not_said_to_be_wrong() -> None:
    bias = replace(
        PAYLOAD, kind=Kind.SENSOR, effect="grade_bias", family="sensors", stated="mismatch",
        says="the recorded grade is offset", probability=0.45, family_probability=0.5,
        credible_set=("rolling_resistance",),
    )  # fmt: skip
    v = Verdict(Conclusion.SENSOR, (bias,))
    assert lines.headline(v) == "Grade bias is most probable (45 %): see what to do"
    assert lines.cause(bias) == "Sensors, 50 %: grade bias 45 %; or, of another part, rolling resistance."
    assert next(iter(lines.what_to_do(v))).startswith("Check before you record more whether")
    stated = replace(v, findings=(replace(bias, stated="grade_bias"),))
    assert lines.headline(stated) == "The recorded grade is offset: repair the sensor"


def test_what_is_stated_beside_a_good_simulator_is_said_with_it_and_a_larger_part_too() -> None:
    f = replace(PAYLOAD, effect="shift_interruption", family="engine_driveline", share_of_error=0.21)
    f = replace(f, stated="shift_interruption", depends_on=("gear",))
    load, rest = (Part(n, x, x, x, 1.0, np.zeros(0)) for n, x in (("load", 0.59), ("left_over", 0.2)))
    off = Verdict(Conclusion.PHYSICS, (f,), budget=Budget(40.0, 9, 0.5, (load, rest)))
    assert lines.headline(off) == (
        "The largest part is load 59 %, of which no name is certain; shift interruption is missing, 21 % of "
        "the squared error: see what to do"
    )
    smaller = replace(off, budget=Budget(40.0, 9, 0.5, (replace(load, share=0.2, low=0.2), rest)))
    wide = replace(off, budget=Budget(40.0, 9, 0.5, (replace(load, low=0.01, high=0.96), rest)))
    assert "load" not in lines.headline(wide) and "load 59 % (1 to 96)" in " ".join(lines.what(wide))
    assert "load" not in lines.headline(smaller)
    family = replace(f, stated=f.family, probability=0.88)
    assert lines.headline(replace(smaller, findings=(family,))).startswith(
        "An effect in engine and driveline is missing, most probably shift interruption (88 %), 21 % of"
    )
    wind = Alternative("headwind", 0.52, Size(6.1, "m/s", (4.0, 8.0)), 0.7)
    tyres = Alternative("rolling_resistance_speed", 0.4, Size(43.0, "N s/m", (30.0, 56.0)), 3.0)
    equal = replace(
        f, effect="headwind", family="air_tyres_road", stated="air_tyres_road", share_of_error=None,
        alternatives=(wind, tyres), separating_manoeuvre="drive both ways at two speeds",
    )  # fmt: skip
    assert lines.headline(Verdict(Conclusion.PHYSICS, (equal,))) == (
        "An effect in air, tyres and road is missing: headwind (52 %, +6.1 m/s, usual) or rolling resistance "
        "speed (40 %, +43 N s/m, 3.0 times the usual): to distinguish them, drive both ways at two speeds"
    )
    good = replace(off, advice={"simulator": Advice(Answer.YES, "off by 0.1 m/s")})
    assert lines.headline(good) == (
        "Shift interruption is missing, 21 % of the squared error; otherwise the simulator is good enough"
    )
    unsure = replace(good, kind=Conclusion.NOTHING)
    assert lines.headline(unsure) == (
        "The simulator is good enough for such drives, although shift interruption may be missing (93 %)"
    )
    fit = FitResult(("d",), 40.0, 3, (), validated=True, offered=REFIT)
    better = lines.headline(replace(good, fit=fit))
    assert better.endswith(
        "otherwise the simulator is good enough; better still: apply the refitted parameters"
    )


def test_a_drive_that_differs_is_in_the_first_line_of_a_good_simulator() -> None:
    own = replace(
        PAYLOAD, effect="unknown", says="a constant force", in_drives=("c",), share_of_error=0.52,
        parameters={"force[c]": Size(-223.4, "N", (-250.0, -200.0), "c")},
    )  # fmt: skip
    good = {"simulator": Advice(Answer.YES, "off by 0.1 m/s")}
    v = Verdict(Conclusion.PHYSICS, (replace(PAYLOAD, share_of_error=0.1), own), advice=good)
    assert lines.headline(v) == (
        "In c (-223 N) alone of the fitted drives, a constant force, 52 % of the squared error; otherwise "
        "the simulator is good enough"
    )


def test_sizes_that_differ_between_a_few_drives_are_in_the_first_line() -> None:
    sizes = {
        f"change[{d}]": Size(x, "kg", (x - 300.0, x + 300.0), d) for d, x in (("a", -10864.4), ("c", 9759.7))
    }
    loads = replace(PAYLOAD, parameters=sizes, share_of_error=0.99, mass_by_drive={"a": 9135.6, "c": 29759.7})
    v = Verdict(Conclusion.PHYSICS, (loads,))
    assert lines.headline(v) == (
        "Payload change is missing (a -10,864 kg, c +9,760 kg), 99 % of the squared error: "
        "set the mass of each drive"
    )
    ratios = {name: replace(size, unit="1") for name, size in sizes.items()}
    assert "(a" not in lines.headline(replace(v, findings=(replace(PAYLOAD, parameters=ratios),)))


def test_events_are_said_with_what_they_do_to_the_speed() -> None:
    lost, gained = Event("a", 12.0, 19.0, -0.42, 0.99, "headwind"), Event("b", 3.0, 8.0, 0.3, 0.99, None)
    v = Verdict(Conclusion.NOTHING, data=Data(compared=0.9), events=(lost, gained, gained, gained))
    assert lines.headline(v).endswith(", but for 4 events of seconds")
    (said,) = [line for line in lines.what(v) if line.startswith("Events")]
    assert "a, 12 to 19 s: 0.42 m/s lost, headwind; b, 3 to 8 s: 0.3 m/s gained; " in said
    assert said.endswith("; 1 more.")
    assert not any(
        line.startswith("Events") for line in lines.what(Verdict(Conclusion.NOTHING, data=Data(compared=0.9)))
    )


def test_an_event_says_what_is_seen_and_names_as_possible_and_a_shift_stands_apart() -> None:
    one = Event("a", 12.0, 19.0, -0.42, 0.99, None, channels=("gap",), possible=(Possible("headwind", 0.62),))
    shift = Event("b", 3.0, 8.0, 0.3, 0.99, None, other_shift=True)
    v = Verdict(Conclusion.NOTHING, data=Data(compared=0.9), events=(one, shift))
    assert lines.headline(v).endswith(", but for 1 event of seconds")
    said = [str(line) for line in lines.what(v)]
    assert any(
        line.endswith("a, 12 to 19 s: 0.42 m/s lost, with an unusual gap, perhaps headwind 62 %.")
        for line in said
    )
    (apart,) = (line for line in said if line.startswith("The simulator shifts at another moment"))
    assert apart.endswith("b, 3 to 8 s: 0.3 m/s gained.")


def test_speeds_are_converted_as_numbers_before_they_are_rounded() -> None:
    size = Size(8.647, "m/s", (7.155, 10.132))
    assert lines.interval(size, 1.0, "m/s", sign=True) == "+8.65 m/s (+7.16 to +10.1)"
    assert shown(lines.interval(size, 1.0, "m/s", sign=True), "km/h") == "+31.1 km/h (+25.8 to +36.5)"
    v = Verdict(Conclusion.NOTHING, advice={"data": Advice(Answer.NO, wording.too_far(2.0, 2.0, 40.0, 0.3))})
    found = Mismatch(v, None, {}, None, ())
    assert "off by 7.2 km/h" in str(found.verdict_in("km/h")["sentences"])
    assert found.verdict["headline"] in found._repr_html_() and summary(v) == found.verdict["sentences"]
    off = opened(wording.good(0.3961, 40.0))
    assert off.startswith("Free runs of 40 s on held-out drives are off by 0.4 m/s, and")
    assert "off by 1.4 km/h, and nothing" in shown(off, "km/h")
    assert shown(str(Bound("speed", 12.84, np.inf, "m/s")), "mph") == "speed > 28.7 mph"
    assert shown(wording.better(31.0, 3.0, refit=False), "km/h").endswith("falls from 112 to 11 km/h")
