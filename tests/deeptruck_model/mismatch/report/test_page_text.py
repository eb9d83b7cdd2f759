"""What the page says of a group: what decided against each of its names; and in which words."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

from deeptruck_model.mismatch.finding import Finding, Kind, Rival
from deeptruck_model.mismatch.posterior.causes import Cause
from deeptruck_model.mismatch.report import findings, text, wording
from deeptruck_model.mismatch.report.forces import strength
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.result import Bound, Regime
from deeptruck_model.mismatch.rules import Rules
from deeptruck_model.mismatch.sentence import Named, Sentence

INF = float("inf")


def finding(effect: str, worse: Mapping[str, float], group: tuple[str, ...], **more: Any) -> Finding:
    """With rivals that are worse by so many nats, of which `group` is not distinguishable."""
    usual: dict[str, Any] = {
        "kind": Kind.PHYSICS,
        "says": Sentence.of("a force"),
        "equation": "F = 0",
        "parameters": {},
        "probability": 0.3,
        "would_be_told_by": Sentence.of("coast down"),
        "depends_on": (),
        "rivals": tuple(Rival(name, nats) for name, nats in worse.items()),
    }
    return Finding(effect=effect, cannot_be_told_from=group, **(usual | more))


@pytest.mark.parametrize(
    ("rivals", "said"),
    [
        ({}, "its signals, by which headwind acts too; its form is another"),
        ({"unknown": 12.0}, "a force without a name that comes and goes likewise the data, by 12.0 nats"),
    ],
)
def test_unknown_is_in_a_group_by_its_signals_or_as_a_force_that_comes_and_goes(
    rivals: dict[str, float], said: str
) -> None:
    assert said in wording.apart(finding("headwind", rivals, ("unknown",)))


def told(effect: str, **worse: float) -> str:
    return wording.apart(finding(effect, worse, tuple(worse)))


def test_a_rival_that_does_better_is_said_to() -> None:
    said = told("rolling_resistance", accessory_load=-800.7, road_surface=-789.6, brake_gain=132.3)
    assert "In place of rolling resistance, these fit the data better than it does: " in said
    assert "accessory load by 800.7 nats and road surface by 789.6 nats." in said
    assert "What decided against the others: against brake gain the data, by 132.3 nats." in said
    assert "hardly" not in said and "-" not in said


def test_a_parameter_that_a_name_beats_says_why_it_is_told_nevertheless() -> None:
    parameter, physics = (
        wording.apart(finding("drag_area", {"headwind": -61.0}, ("headwind",), kind=kind))
        for kind in (Kind.PARAMETER, Kind.PHYSICS)
    )
    assert wording.REFITTED in parameter and wording.REFITTED not in physics


def test_a_rival_that_does_little_better_leaves_it_undecided() -> None:
    assert wording.UNDECIDED in told("rolling_resistance", accessory_load=-3.0)
    assert wording.UNDECIDED not in told("rolling_resistance", accessory_load=-300.0)


def test_where_no_nats_were_told_none_are_explained() -> None:
    assert "nats" not in told("accessory_load", unknown=0.0)
    assert "Nothing speaks against brake gain: it may do as well." in told(
        "rolling_resistance", brake_gain=0.0
    )
    likeness = wording.apart(finding("mass", {}, ("clock_offset",), kind=Kind.PARAMETER))
    assert f"{wording.LIKENESS} clock offset: {wording.NOT_NEAR}." in likeness and "as well." not in likeness
    assert told("rolling_resistance", brake_gain=3.0).endswith(wording.IN_PLACE)


@pytest.mark.parametrize(("kind", "explained"), [("missing_physics", True), ("parameter_error", False)])
def test_a_name_that_beats_all_others_says_why_it_is_not_surer(
    kind: str, explained: bool, nothing_missing: Evidence
) -> None:
    sizes = {"road_grade": 0.01, "headwind": 3.0, "torque_derate": 0.1}
    rivals = (("road_grade", 20.0),)
    cause = Cause(kind, "headwind", 50.0, 1.0, np.zeros(len(nothing_missing)), rivals=rivals, needed=sizes)
    slow: Any = None  # of a slow force nothing is read from the explanation
    found = findings.from_cause(cause, nothing_missing, slow, {})
    said = wording.apart(found)
    said_first = "It is distinguishable from every other name; the next best, road grade, is 20 nats worse."
    assert said.startswith(said_first)
    assert said.endswith(wording.LIMIT.format(wording.percent(found.probability))) == explained
    assert (found.probability <= Rules.recognised) == explained


def test_a_name_beside_another_is_as_sure_as_its_share(nothing_missing: Evidence) -> None:
    sizes = {"road_grade": 0.01, "headwind": 3.0, "torque_derate": 0.1}
    cause = Cause(
        "missing_physics",
        "headwind",
        50.0,
        1.0,
        np.zeros(len(nothing_missing)),
        rivals=(("road_grade", 0.0),),
        needed=sizes,
    )
    slow: Any = None
    found = findings.from_cause(cause, nothing_missing, slow, {})
    assert found.cannot_be_told_from == ("road_grade",)
    assert found.probability == pytest.approx(Rules.recognised / 2, abs=0.001)


def test_no_name_of_the_program_is_in_a_sentence() -> None:
    said = wording.prose(
        "simulated on a road, full pull from 3 m/s tells it from rolling_resistance_speed: 2.0 m/s apart; "
        "nearest name: road_grade; +-2 m/s^2"
    )
    assert said == (
        "simulated on a road, full pull from 3 m/s tells it from rolling resistance that grows with speed: "
        "2.0 m/s apart; nearest name: road grade; ±2 m/s²"
    )


@pytest.mark.parametrize(
    ("where", "said"),
    [
        (
            [Bound("change of brake_command", 9.2, INF, "percent")],
            "change of the brake command within about 1 s above 9.2 percent",
        ),
        (
            [Bound("engine", 0.287, 0.481, "m/s²"), Bound("brake", -INF, 0.243, "m/s²")],
            "engine force per mass from 0.287 to 0.481 m/s² and brake force per mass below 0.243 m/s²",
        ),
        (
            [Bound("engine over 60 s", -INF, 0.0806, "m/s²")],
            "engine force per mass over 60 s below 0.0806 m/s²",
        ),
        ([Bound("engine_command", -6.62, 1899.7, "N m")], "engine command from -6.62 to 1900 N m"),
        ([Bound("elapsed", 33.1, INF, "s")], "time since the recording began above 33.1 s"),
        (
            [Bound("braking power over 300 s", 1.05, INF, "W/kg")],
            "braking power per mass over 300 s above 1.05 W/kg",
        ),
        ([], "everywhere"),
    ],
)
def test_a_condition_is_in_words(where: list[Bound], said: str) -> None:
    assert wording.condition(Regime(tuple(where), 0.5, 0.1)) == said


def test_what_an_unknown_force_varies_with_is_in_words() -> None:
    drivers = Sentence.named(["elapsed", "engine", "simulated"])
    said = Sentence.of(
        "a force: +-3 N. It varies with ", *drivers, ". The nearest name, ", Named("turbo_lag")
    )
    assert wording.prose(said) == (
        "a force: ±3 N. It varies with time since the recording began, engine force per mass, "
        "simulated acceleration. The nearest name, turbo lag"
    )
    assert str(said).endswith("It varies with elapsed, engine, simulated. The nearest name, turbo_lag")


def test_every_special_word_is_for_a_name_that_there_is() -> None:
    assert all(findings.known(name) for name in wording.SPOKEN)


def test_what_would_settle_it_is_in_words() -> None:
    group = ("rolling_resistance_speed", "unknown")
    told_by = Sentence.of("coast down; of 8 others, none tells it from ", Named(group[0]))
    warm = "rolling_resistance_warmup"
    says = Sentence.of(Named(warm))
    shown = text.told(0, finding(warm, {}, group, says=says, would_be_told_by=told_by))
    assert not re.search(r"[a-z]_[a-z]", f"{shown.name} {shown.says} {shown.to_be_sure} {shown.apart}")
    assert shown.to_be_sure.endswith("tells it from rolling resistance that grows with speed.")


@pytest.mark.parametrize(
    ("swings", "said"), [(False, "+3000 N on average"), (True, "3000 N rms, forward and back")]
)
def test_a_force_of_both_signs_has_an_rms(nothing_missing: Evidence, swings: bool, said: str) -> None:
    e = nothing_missing
    sign = np.where(np.arange(len(e)) // 50 % 2, -1.0, 1.0) if swings else 1.0
    force = Cause("missing_physics", "headwind", 50.0, 1.0, sign * np.full(len(e), 3000.0 / e.mass))
    assert strength(force, e) == said  # all the time, and so without the time in which it acts


def test_a_short_memory_is_put_in_words_once() -> None:
    """A page said 'simulated simulated acceleration over 2 s': words pass through here more than once."""
    said = wording.prose("acceleration over 2 s above 0.85 m/s^2")
    assert "simulated acceleration over 2 s" in said
    assert wording.prose(said) == said
