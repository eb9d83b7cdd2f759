"""A manoeuvre is said to tell two explanations apart where the truck driven under each of them differs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from deeptruck_model import trucks
from deeptruck_model.mismatch.finding import Finding, Kind
from deeptruck_model.mismatch.mechanisms import LIBRARY, is_time_varying
from deeptruck_model.mismatch.posterior.causes import Cause
from deeptruck_model.mismatch.posterior.search import Model, Search
from deeptruck_model.mismatch.report.identifiability import MANOEUVRES, checked, separation
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.sentence import Sentence

TRUCK = trucks.load("trucksim")


@pytest.fixture(scope="module")
def lossy(nothing_missing: Evidence) -> Evidence:
    """A driveline that loses an eighth, on a truck whose commands are N m and percent."""
    signals = nothing_missing.signals | {"engine_command": 3000.0 * nothing_missing["engine"]}
    signals["brake_command"] = 40.0 * (nothing_missing["brake"] > 0.0)
    lost = 0.125 * np.abs(nothing_missing["engine"])
    return replace(nothing_missing, signals=signals, residual=nothing_missing.residual - lost)


@pytest.fixture(scope="module")
def models(lossy: Evidence) -> dict[str, Model]:
    search = Search(lossy)
    gusts = next(s for s in search.candidate_terms(LIBRARY["headwind"]) if is_time_varying(s))
    return {
        "loss": search.model((search.candidate_terms(LIBRARY["driveline_loss"])[0],), frozenset()),
        "gain": search.model((), frozenset({"torque_gain"})),
        "nothing": search.model((), frozenset()),
        "gusts": search.model((gusts,), frozenset()),
    }


def finding(e: Evidence, model: Model, rival: str, other: Model) -> Finding:
    term = model.named[0]
    cause = Cause(
        "missing_physics", term.mechanism.effect, 90.0, 1.0, np.zeros(len(e)), term,
        ((rival, 3.0),), alternatives=((rival, other),),
    )  # fmt: skip
    return told("coast", rival, cause)


def told(by: str, rival: str, cause: Cause) -> Finding:
    """A finding that is told by a manoeuvre, but not from a rival."""
    kind, says, would = Kind(cause.kind), Sentence.of("something is off"), Sentence.of(by)
    return Finding(
        kind, cause.effect, says, "F = 0", {}, 0.9, would, (), cannot_be_told_from=(rival,), cause=cause
    )


def test_one_explanation_is_not_told_from_itself(lossy: Evidence, models: dict[str, Model]) -> None:
    assert separation(TRUCK, lossy, models["loss"], models["loss"]).telling == 0.0
    alike = checked(finding(lossy, models["loss"], "twin", models["loss"]), TRUCK, lossy, models["loss"])
    assert "none tells it from twin" in str(alike.would_be_told_by)


def test_a_lost_eighth_of_the_pull_shows_in_a_pull(lossy: Evidence, models: dict[str, Model]) -> None:
    s = separation(TRUCK, lossy, models["loss"], models["nothing"])
    assert "pull" in s.words and s.telling > 5.0 and s.apart > 1.0


def test_it_is_said_which_manoeuvre_tells(lossy: Evidence, models: dict[str, Model]) -> None:
    found = finding(lossy, models["loss"], "nothing", models["nothing"])
    words = str(checked(found, TRUCK, lossy, models["loss"]).would_be_told_by)
    assert (
        words.startswith(f"coast. Of {len(MANOEUVRES)} others, simulated on a flat road, ")
        and "tells it from nothing" in words
    )


def test_what_comes_and_goes_is_not_simulated(lossy: Evidence, models: dict[str, Model]) -> None:
    found = finding(lossy, models["gusts"], "torque_gain", models["gain"])
    assert checked(found, TRUCK, lossy, models["gusts"]) is found


def test_a_parameter_is_driven_against_the_law_in_its_place(
    lossy: Evidence, models: dict[str, Model]
) -> None:
    cause = Cause(
        "parameter_error", "torque_gain", 90.0, 1.0, np.zeros(len(lossy)), None,
        (("driveline_loss", 3.0),), alternatives=(("driveline_loss", models["loss"]),), whole=models["gain"],
    )  # fmt: skip
    found = told("pull", "driveline_loss", cause)
    words = str(checked(found, TRUCK, lossy, models["nothing"]).would_be_told_by)
    s = separation(TRUCK, lossy, models["gain"], models["loss"])
    says = f"{s.words} tells it" if s.telling >= 1.0 else "none tells it"
    assert s.telling > 0.0 and f" others, simulated on a flat road, {says} from driveline_loss" in words
