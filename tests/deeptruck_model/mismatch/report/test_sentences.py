"""The sentences of verdicts that were made by hand: one table of what is said, and the numbers in them."""

from __future__ import annotations

import re
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
from deeptruck_model.mismatch.folders import CORRECTION, NOT_SIGNIFICANT, REFIT
from deeptruck_model.mismatch.output import summary
from deeptruck_model.mismatch.posterior.budget import Budget, Part
from deeptruck_model.mismatch.posterior.events import Event, Possible
from deeptruck_model.mismatch.posterior.names import Node
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

PHYSICS, PARAMETER, SENSOR, NOTHING = (
    Conclusion.PHYSICS, Conclusion.PARAMETER, Conclusion.SENSOR, Conclusion.NOTHING,
)  # fmt: skip
FORCE = Strength(-699.4, "N", one_way=True, share_of_time=0.82, ci95=(-790.0, -610.0))
WIND = Finding(
    Kind.PHYSICS, "headwind", "air_tyres_road", "headwind", "wind along the road", "", {}, "drive both ways",
    ("speed",), 0.93, 0.95, strength=FORCE,
)  # fmt: skip
UNSURE = replace(
    WIND,
    stated="air_tyres_road",
    credible_set=("headwind", "rolling_resistance_speed", "drafting"),
    alternatives=(
        Alternative("headwind", 0.52, Size(6.1, "m/s", (4.0, 8.0)), 0.7),
        Alternative("rolling_resistance_speed", 0.4, Size(43.0, "N s/m", (30.0, 56.0)), 3.0),
        Alternative("drafting", 0.1),
    ),
)
LOADS = replace(
    WIND, effect="payload_change", family="load", stated="payload_change",
    parameters={n: Size(x, "kg", (x - 300.0, x + 300.0), n) for n, x in (("a", -4020.0), ("c", 9759.7))},
    mass_by_drive={"a": 9135.6, "c": 29759.7},
)  # fmt: skip
MASS = replace(
    WIND, kind=Kind.PARAMETER, effect="mass", family="load", stated="mass", says="the mass is 20 % larger",
    parameters={
        "mass": Size(24000.0, "kg", (22000.0, 26000.0)), "relative_error": Size(0.2, "1", (0.1, 0.3)),
    },
)  # fmt: skip
DRAG = replace(
    MASS, effect="drag_area", stated="mismatch", probability=0.68,
    parameters={"relative_error": Size(0.27, "1", (0.06, 0.47))},
)  # fmt: skip
SLOW = replace(WIND, effect="unknown", family="unknown", stated="unknown", says=wording.DRIFT["slow"])
BIAS = of_fault(SensorFault("acceleration_bias", -1.0, 0.0, "1", "the accelerometer has the wrong sign"))
FIT = FitResult(("d",), 40.0, 3, (), validated=True, offered=CORRECTION)
GOOD = {"simulator": Advice(Answer.YES, "off by 0.1 m/s")}
OFF = {"simulator": Advice(Answer.NO, "off by 0.7 m/s; good enough is 0.3 m/s")}
NO_RUN = {"simulator": Advice(Answer.UNSURE, wording.NOT_DRIVEN)}
GUST = Event("a", 12.0, 19.0, -0.42, 0.99, "headwind")
SHIFT = Event("b", 3.0, 8.0, 0.3, 0.99, None, other_shift=True)
SEEN = replace(GUST, name=None, channels=("gap",), possible=(Possible("headwind", 0.62),))


def parts(**shares: tuple[float, float, float]) -> Budget:
    each = tuple(Part(n, share, low, high, 1.0, np.zeros(0)) for n, (share, low, high) in shares.items())
    return Budget(40.0, 9, 0.5, each)


def errors(before: float, refitted: float) -> FreeRunErrors:
    return FreeRunErrors(Rmse(before, 0.1), Rmse(refitted, 0.1), Rmse(before, 0.1))


REFITTED = replace(
    FIT, offered=REFIT, tolerance=0.3, errors=errors(0.6, 0.01),
    refit={
        "mass": Refitted(0.168, (0.08, 0.26)), "drag_area": Refitted(-0.2, (-0.24, -0.16)),
        "torque_gain": Refitted(0.02, (-0.01, 0.05)),
    },
)  # fmt: skip
UNDETERMINED = Conclusion.UNDETERMINED
SHIFTED = replace(FIT, corrected_parameters={"mass": 0.101, "drag_area": 0.19, "torque_gain": 0.002})
HEADLINES = [  # a verdict, and what is named, by how much, and what is to be done
    (Verdict(PHYSICS, (WIND,)), "Headwind is .*drive both ways"),
    (Verdict(PHYSICS, (WIND,), fit=FIT), "Headwind is .*apply the correction"),
    (Verdict(PHYSICS, (replace(WIND, in_drives=("b", "c")),)), "Headwind is .* b, c .*drive both ways"),
    (Verdict(PHYSICS, (UNSURE,)),
     r" headwind \(52 %\), rolling resistance speed \(40 %\) or 1 other.*both ways"),
    (Verdict(PHYSICS, (replace(WIND, stated="mismatch", probability=0.85, separating_manoeuvre=""),)),
     r" headwind \(85 %\): see"),
    (Verdict(PHYSICS, (replace(WIND, share_of_error=0.2),), budget=parts(load=(0.6, 0.4, 0.7))),
     r"Headwind is .*larger part \(load\).*drive both ways"),
    (Verdict(PHYSICS, (LOADS,)), r"Payload change is .*\(a -4,020 kg, c \+9,760 kg\): set the mass"),
    (Verdict(PARAMETER, (MASS,)), "Mass .* is wrong: .*drive both ways"),
    (Verdict(PHYSICS, (SLOW,)), "slow force .*drive both ways"),
    (Verdict(SENSOR, (BIAS,)), "wrong sign: repair"),
    (Verdict(PHYSICS, (WIND,), advice=GOOD), "Headwind is .*good enough for these drives$"),
    (Verdict(PHYSICS, (WIND,), advice=GOOD, fit=FIT), "Headwind is .*good enough .*apply the correction"),
    (Verdict(NOTHING, (DRAG,)), r"good enough .*drag area .*\(68 %\)"),
    (Verdict(NOTHING, events=(GUST, GUST, SHIFT)), "Nothing .* 2 events .*good enough"),
    (Verdict(UNDETERMINED, events=(GUST,), advice=OFF, fit=FIT), "not good enough .*apply the correction"),
    (Verdict(UNDETERMINED, advice=OFF, fit=REFITTED),
     r"Mass \+17 % and drag area -20 % are wrong .*refitted parameters"),
    (Verdict(UNDETERMINED, advice=OFF, fit=replace(REFITTED, errors=errors(0.6, 0.4))),
     "not good enough .*refitted parameters"),
    (Verdict(UNDETERMINED, advice=NO_RUN), "no held-out recording .*: see"),
    (Verdict(PHYSICS, (WIND,), fit=FIT, data=Data(doubts=("are the two swapped?",))),
     "Headwind is .*: settle"),
    (Verdict(UNDETERMINED, fit=SHIFTED),
     r"Mass \+10 % and drag area \+19 % are wrong .*apply the correction"),
]  # fmt: skip


@pytest.mark.parametrize(("verdict", "says"), HEADLINES)
def test_the_first_line(verdict: Verdict, says: str) -> None:
    """It has one kind of percent, and no share of the error beside a probability."""
    assert re.search(says, lines.headline(verdict)), lines.headline(verdict)


ADDED = replace(
    FIT, corrected_parameters={"mass": 0.2, "torque_gain": 0.1}, corrected_forces={"headwind": FORCE}
)
LINES = [  # a verdict, what is said, and what is not
    (Verdict(PARAMETER, (MASS,)), "mass: 24,000 kg (22,000 to 26,000), +20 % (+10 to +30).", "e+"),
    (
        Verdict(PHYSICS, (replace(UNSURE, parameters={"wind": Size(4.37, "m/s", (0.43, 8.31))}),)),
        "if headwind: 4.37 m/s (0.43 to 8.31), mean -699 N (-790 to -610) while it acts.",
        "usual",
    ),
    (
        Verdict(PHYSICS, (replace(WIND, parameters={"keeps_s": Size(12.0, "s", (11.4, 12.7))}),)),
        "headwind: keeps 12 s (11.4 to 12.7), mean",
        "keeps s",
    ),
    (
        Verdict(PHYSICS, (replace(WIND, parameters={"share_0_to_0.3_s": Size(0.2, "1", (0.1, 0.3))}),)),
        "headwind: mean -699 N (-790 to -610) while it acts.",
        "share",
    ),
    (
        Verdict(PHYSICS, (MASS, WIND), fit=ADDED),
        "The correction contains: mass 24,000 kg (22,000 to 26,000), +20 % (+10 to +30); torque gain +10 %; "
        "headwind mean -699 N (-790 to -610) while it acts.",
        "Most probable sizes",
    ),
    (
        Verdict(PHYSICS, (LOADS,), fit=ADDED),
        "It does not contain payload change, which the first line names",
        "Check",
    ),
    (
        Verdict(NOTHING, fit=replace(FIT, offered=REFIT, refit={"mass": Refitted(0.168, (0.08, 0.26))})),
        "Refitted parameters: mass +17 % (+8 to +26).",
        "The correction contains",
    ),
    (
        Verdict(NOTHING, (DRAG,), fit=FitResult(("d",), 40.0, 3, (), at_high_speed={"drag_area": -3.0})),
        "off by +27 % (+6 to +47); on a level road at 25 m/s that adds up to -0.81 m/s (-1.41 to -0.18) "
        "after 40 s",
        "Apply",
    ),
    (
        Verdict(PHYSICS, (LOADS,), fit=FIT),
        'Set the simulator\'s mass for each drive, kg: {"a": 9136, "c": 29760}.',
        "0.0804",
    ),
    (
        Verdict(PHYSICS, (WIND,), fit=FIT, data=Data(doubts=("are the two swapped?",))),
        "Doubtful input: are the two swapped?",
        "Apply the correction:",
    ),
    (
        Verdict(PHYSICS, (replace(WIND, missing_input="gear"),)),
        "headwind 93 % (or the truck only changes gear otherwise: gear was not recorded).",
        "Record what is listed",
    ),
    (
        Verdict(NOTHING, budget=parts(load=(0.7, 0.5, 0.9), brakes=(0.2, 0.0, 0.65))),
        "Shares of the squared error: load 70 %, brakes not known (up to 65 %).",
        "(0 to",
    ),
    (
        Verdict(NOTHING, events=(GUST, replace(GUST, speed_change=0.3, name=None), GUST, GUST)),
        "a, 12 to 19 s: 0.42 m/s lost, headwind; a, 12 to 19 s: 0.3 m/s gained; a, 12 to 19 s: 0.42 m/s "
        "lost, headwind; 1 more.",
        "Shares",
    ),
    (
        Verdict(NOTHING, events=(SEEN, SHIFT)),
        "a, 12 to 19 s: 0.42 m/s lost, with an unusual gap, perhaps headwind 62 %. The simulator shifts at "
        "another moment, which says nothing of forces: b, 3 to 8 s: 0.3 m/s gained.",
        "more",
    ),
    (
        Verdict(UNDETERMINED, tree=(Node("brakes", "mismatch", 0.4),)),
        "No name is established; parts of the truck: brakes 40 %.",
        "Apply",
    ),
    (Verdict(SENSOR, (BIAS,)), "before you record more: the accelerometer has the wrong sign.", "Apply"),
]  # fmt: skip


@pytest.mark.parametrize(("verdict", "says", "not_said"), LINES)
def test_a_sentence(verdict: Verdict, says: str, not_said: str) -> None:
    said = " ".join(lines.lines(verdict))
    assert says in said and not_said not in said


@pytest.mark.parametrize(
    ("low", "high", "says"),
    [
        (0.2, 0.5, "falls by 20 to 50 % (95 % interval)"),
        (-3.87, 0.45, "is between 45 % lower and 387 % higher"),
        (-0.4, 0.1, f": {NOT_SIGNIFICANT}; not validated."),
        (-0.4, -0.1, "rises by 10 to 40 %"),
    ],
)
def test_a_change_of_the_error_is_said_with_its_direction(low: float, high: float, says: str) -> None:
    change = Improvement((low, high), (low, high), 1)
    fit = FitResult(("a",), 40.0, 3, ("headwind",), improvement=change)
    assert says in page.errors_say(Verdict(PHYSICS, (WIND,), fit=fit))


def test_speeds_are_converted_as_numbers_before_they_are_rounded() -> None:
    size = Size(8.647, "m/s", (7.155, 10.132))
    assert shown(lines.sized(size, sign=True), "km/h") == "+31.1 km/h (+25.8 to +36.5)"
    off = Verdict(NOTHING, advice={"data": Advice(Answer.NO, wording.too_far(2.0, 2.0, 40.0, 0.3))})
    found = Mismatch(off, None, {}, None, ())
    assert "off by 7.2 km/h" in str(found.verdict_in("km/h")["sentences"])
    assert found.verdict["headline"] in found._repr_html_() and summary(off) == found.verdict["sentences"]
    assert str(Bound("time since start", -np.inf, 1087.3, "s")) == "time since start < 1,087 s"
    bound = str(Bound("speed", 12.84, np.inf, "m/s"))
    first = lines.headline(Verdict(PHYSICS, (replace(WIND, in_condition=bound),)))
    assert re.search(r"mostly where speed > 28\.7 mph", shown(first, "mph"))
    assert shown(wording.better(31.0, 3.0, refit=False), "km/h").endswith("falls from 112 to 11 km/h")
