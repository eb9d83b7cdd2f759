"""Which names a cause is not distinguishable from, and how sure its own is."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from deeptruck_model.mismatch.posterior.causes import Cause
from deeptruck_model.mismatch.rules import Rules

RIVALS = (("drafting", 2.0), ("drag_area", 9.0), ("road_grade", 27.0), ("mass", 40.0))


def cause(gain: float = 30.0, rivals: tuple[tuple[str, float], ...] = RIVALS, **more: bool) -> Cause:
    return Cause("missing_physics", "headwind", gain, 0.5, np.zeros(1), rivals=rivals, **more)


def test_names_share_the_probability_by_their_evidence() -> None:
    names = cause(gain=1e3 * Rules.temper, rivals=(("drafting", 150.0),)).by_forms
    assert list(names) == ["headwind", "drafting"]
    assert sum(names.values()) == pytest.approx(1.0)
    assert names["headwind"] / names["drafting"] == pytest.approx(math.exp(150.0 / (Rules.coarse * 3e3)))


def test_the_more_was_gained_the_more_must_decide() -> None:
    """A form that is not quite right costs in proportion to what is explained: more data decides nothing."""
    assert cause(gain=30.0, rivals=(("drafting", 20.0),)).not_told_from == []
    assert cause(gain=3000.0, rivals=(("drafting", 20.0),)).not_told_from == ["drafting"]
    assert cause(gain=3000.0, rivals=(("drafting", 2000.0),)).not_told_from == []


def test_a_group_holds_the_right_name_with_the_probability_that_is_asked() -> None:
    c = cause(gain=200.0)
    kept = c.names[c.effect] + sum(c.names[name] for name in c.not_told_from)
    assert kept >= Rules.credible
    assert kept - c.names[c.not_told_from[-1]] < Rules.credible


def test_a_rival_that_does_better_is_in_the_group_and_takes_its_share() -> None:
    c = replace(cause(rivals=(("drafting", -5.0),)), kind="parameter_error")
    assert c.not_told_from == ["drafting"]
    assert c.believed < 0.5


def test_a_small_gain_may_be_nothing() -> None:
    assert cause(gain=2.0, rivals=()).believed < cause(gain=50.0, rivals=()).believed


def test_another_form_may_be_something_unknown() -> None:
    assert cause(rivals=(), other_form=True).not_told_from == ["unknown"]
    assert cause(rivals=(("unknown", 0.0),), other_form=True).not_told_from == ["unknown"]  # once


def test_by_forms_a_name_is_believed_no_more_than_such_names_proved_right() -> None:
    alone = cause(gain=100.0, rivals=())
    assert alone.believed == pytest.approx(Rules.recognised)
    assert replace(alone, effect="unknown").believed == pytest.approx(Rules.recognised)
    assert replace(alone, kind="parameter_error").believed == pytest.approx(1.0)


def test_three_quarters_of_a_name_go_by_its_likeness() -> None:
    c = replace(cause(gain=100.0, rivals=()), likeness=(("headwind", 0.4), ("drag_area", 0.6)))
    assert list(c.names) == ["headwind", "drag_area"]
    assert c.believed == pytest.approx(0.55, abs=0.01) and c.not_told_from == ["drag_area"]
    liker = replace(c, likeness=(("headwind", 0.3), ("drag_area", 0.7)))
    assert list(liker.names) == ["drag_area", "headwind"]
    agreed = replace(c, likeness=(("headwind", 0.9), ("drag_area", 0.1)))
    assert agreed.believed == pytest.approx(0.925, abs=0.01) and agreed.not_told_from == []


@pytest.mark.parametrize(
    ("gain", "left_over", "told"),
    [
        (2000.0, math.inf, 0.55),  # as laws stray: by likeness for three quarters
        (2000.0, 0.0, 0.80),  # by less than half of what they do
        (20.0, math.inf, 0.85),  # noise is more than the form's error
    ],
)
def test_likeness_counts_for_as_much_as_the_law_may_stray(gain: float, left_over: float, told: float) -> None:
    c = replace(
        cause(gain=gain, rivals=()),
        likeness=(("headwind", 0.4), ("drag_area", 0.6)),
        left_over=left_over,
    )
    assert c.believed == pytest.approx(told, abs=0.01)


def test_beside_a_law_that_leaves_nothing_over_forms_decide_sooner() -> None:
    c = cause(gain=3000.0, rivals=(("drafting", 100.0),))
    assert c.not_told_from == ["drafting"]
    assert replace(c, left_over=0.0).not_told_from == []
    assert replace(c, left_over=150.0).not_told_from == ["drafting"]


def test_what_is_told_by_another_name_keeps_the_evidence_of_the_one_it_was_found_by() -> None:
    c = replace(cause(gain=100.0, rivals=()), likeness=(("headwind", 0.3), ("drag_area", 0.7)))
    told = replace(c, effect="drag_area", nearest="headwind", found_as="headwind")
    assert told.names == c.names and told.believed == c.names["drag_area"]


def test_what_is_unknown_acts_as_the_nearest() -> None:
    unknown = replace(cause(), effect="unknown", nearest="headwind")
    assert unknown.acts_as == "unknown" and unknown.predictable  # without a term there is no form
