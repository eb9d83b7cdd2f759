"""What a variant of a candidate term can be asked, and how it is kept."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest

from deeptruck_model.mismatch.mechanisms import LIBRARY, saved
from deeptruck_model.mismatch.mechanisms.base import every_variant
from deeptruck_model.mismatch.mechanisms.brakes import Keeps
from deeptruck_model.mismatch.mechanisms.variants import (
    FromMoment,
    OwnCurve,
    PerRecording,
    Spline,
    Static,
    Sum,
    Variant,
)
from deeptruck_model.mismatch.residual.evidence import Evidence

SPLINE = Spline("elapsed", (3, 4), ("a", "b"), 20.0, 1.0 / 7.0, 0.1)
EACH = PerRecording(("a", "b"), 0.5)
LATER = FromMoment(1, 30.0, 2, 32)


@pytest.mark.parametrize(
    ("variant", "varies", "trials"),
    [
        (Static(), False, 1.0),
        (OwnCurve(0, (1.0, 2.0), 1.0), False, 3.0),
        (LATER, False, 32.0),
        (EACH, False, 1.0),
        (SPLINE, True, 20.0),
        (replace(SPLINE, knots=()), False, 1.0),
        (Sum((Static(), EACH)), False, 1.0),
        (Sum((Static(), SPLINE)), True, 1.0),
    ],
)
def test_what_is_asked_of_a_variant_is_asked_of_all_it_is_made_of(
    variant: Variant, varies: bool, trials: float
) -> None:
    assert (variant.varies_in_time, variant.trials) == (varies, trials)


def test_constants_are_reported_with_those_of_every_summand() -> None:
    both = Sum((Static(Keeps(30.0)), LATER))
    assert dict(both.numbers()) == {"keeps_s": 30.0, "after_s": 30.0}


def test_every_variant_is_the_same_after_it_was_kept(nothing_missing: Evidence) -> None:
    for mechanism in LIBRARY.values():
        if nothing_missing.has(*mechanism.needs):
            for variant in every_variant(mechanism, nothing_missing):
                whole = Sum((variant, variant))
                again = saved.variant_of(json.loads(json.dumps(saved.to_json(whole))))
                assert again == whole


@pytest.mark.parametrize(
    "damaged",
    [
        {},
        {"kind": "Nothing"},
        {"kind": "Keeps", "keeps_s": 30.0},
        {"kind": "Sum", "summands": 3},
        {"kind": "Static", "constants": {"kind": "Keeps", "keeps_s": "long"}},
        {"kind": "Static", "constants": {"kind": "Keeps", "keeps_s": float("nan")}},
        saved.to_json(SPLINE) | {"knots": [3, "four"]},
        saved.to_json(SPLINE) | {"colour": 1},
        [],
        "Static",
    ],
)
def test_what_was_not_kept_so_is_refused(damaged: object) -> None:
    with pytest.raises((ValueError, TypeError, KeyError)):
        saved.variant_of(damaged)
