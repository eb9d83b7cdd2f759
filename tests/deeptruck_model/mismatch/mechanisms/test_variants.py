"""How variants are kept, and what a candidate term says of those it is made of."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import pytest

from deeptruck_model.mismatch.mechanisms import LIBRARY, CandidateTerm, Variant, candidate_term, merge, saved
from deeptruck_model.mismatch.mechanisms import variant as variant_with
from deeptruck_model.mismatch.mechanisms.courses import ALWAYS, Course, EachDrive, FromMoment, Spline
from deeptruck_model.mismatch.mechanisms.terms import every_variant
from deeptruck_model.mismatch.residual.evidence import Evidence

SPLINE = Spline("elapsed", (3, 4), ("a", "b"), 20.0, 1.0 / 7.0, 0.1)
EACH = EachDrive(("a", "b"), 0.5)
LATER = FromMoment(1, 30.0, 2)
DRAG = LIBRARY["dragging_brake"]
KEPT = saved.to_json(variant_with("kept", keeps_s=30.0))
SLOW = saved.to_json(variant_with("constant", SPLINE))


@pytest.mark.parametrize(
    ("course", "varies", "general"),
    [
        (ALWAYS, False, True),
        (LATER, False, True),
        (EACH, False, False),
        (SPLINE, True, False),
        (replace(SPLINE, shared=True), True, True),
    ],
)
def test_a_term_is_asked_what_its_courses_are(
    course: Course, varies: bool, general: bool, nothing_missing: Evidence
) -> None:
    term = candidate_term(DRAG, variant_with("constant", course), nothing_missing)
    assert (term.varies_in_time, term.general) == (varies, general)
    both = merge(candidate_term(DRAG, variant_with("kept", keeps_s=3.0), nothing_missing), term)
    assert (both.varies_in_time, both.general) == (varies, general)


def test_a_course_of_an_earlier_version_is_read() -> None:
    now = saved.to_json(variant_with("constant", LATER))
    then = {**now, "course": {**now["course"], "moments": 32}}
    assert saved.variant_of(DRAG, then) == saved.variant_of(DRAG, now)


def test_reported_constants_are_those_of_every_variant(nothing_missing: Evidence) -> None:
    first, other = (
        candidate_term(DRAG, v, nothing_missing)
        for v in (variant_with("kept", keeps_s=30.0), variant_with("constant", LATER))
    )
    both: CandidateTerm = merge(first, other)
    assert list(both.settings()) == [("keeps_s", 30.0, "s"), ("after_s", 30.0, "s")]


def test_every_variant_is_the_same_after_it_was_kept(nothing_missing: Evidence) -> None:
    for mechanism in LIBRARY.values():
        if nothing_missing.has(*mechanism.needs):
            for each in every_variant(mechanism, nothing_missing):
                assert saved.variant_of(mechanism, json.loads(json.dumps(saved.to_json(each)))) == each


@pytest.mark.parametrize(
    "damaged",
    [
        {},
        {"form": "nothing", "constants": {}},
        {"form": "kept"},
        {"form": "kept", "constants": 3},
        KEPT | {"constants": {}},
        KEPT | {"constants": {"keeps_s": "long"}},
        KEPT | {"constants": {"keeps_s": float("nan")}},
        KEPT | {"constants": {"keeps_s": True}},
        KEPT | {"constants": {"keeps_s": 30.0, "colour": 1}},
        {"form": "time since braking", "constants": {"at": [1.0, 2.0]}},
        {"form": "time since braking", "constants": {"at": [1.0, 2.0], "scale": 0.0}},
        SLOW | {"course": SLOW["course"] | {"knots": [3, "four"]}},
        SLOW | {"course": SLOW["course"] | {"colour": 1}},
        SLOW | {"course": SLOW["course"] | {"along": "sideways"}},
        SLOW | {"course": {"kind": "Nothing"}},
        [],
        "kept",
    ],
)
def test_what_was_not_kept_so_is_refused(damaged: Any) -> None:
    with pytest.raises((ValueError, TypeError, KeyError, AttributeError)):
        saved.variant_of(DRAG, damaged)


def test_a_word_that_is_not_permitted_is_refused() -> None:
    lag = saved.to_json(variant_with("lag", side="delay", tau_s=0.3))
    assert saved.variant_of(LIBRARY["brake_lag"], lag) == Variant("lag", (("side", "delay"), ("tau_s", 0.3)))
    with pytest.raises(ValueError, match="'sideways' is no side of brake_lag"):
        saved.variant_of(LIBRARY["brake_lag"], lag | {"constants": {"side": "sideways", "tau_s": 0.3}})
