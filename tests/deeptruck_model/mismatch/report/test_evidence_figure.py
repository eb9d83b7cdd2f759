"""The figure of the names that were weighed."""

from __future__ import annotations

from dataclasses import replace

import pytest
from found_mismatches import mismatch
from matplotlib.colors import to_hex

from deeptruck_model.mismatch.finding import Suspicion
from deeptruck_model.mismatch.posterior.causes import Cause
from deeptruck_model.mismatch.report import error_figures
from deeptruck_model.mismatch.report import text as page_text
from deeptruck_model.mismatch.report.drawing import BLUE, SKY

RANKING = (("brake_fade", 90.0), ("headwind", 14.0), ("dragging_brake", 87.0), ("load_slosh", -31.0))


@pytest.fixture(scope="module")
def drawn():
    found = mismatch("missing_physics")
    made = error_figures.ranking(replace(found.explanation, ranking=RANKING))
    made.canvas.draw()
    return made


def test_names_stand_by_their_nats(drawn) -> None:
    widths = [bar.get_width() for bar in drawn.axes[0].patches[1:-1]]
    assert widths == sorted(widths, reverse=True)


def test_a_bar_below_zero_is_whole_and_its_number_stands_beside_it(drawn) -> None:
    (ax,) = drawn.axes
    assert ax.get_xlim()[0] < -31.0
    (text,) = [t for t in ax.texts if t.get_text() == "-31.0"]
    box = text.get_window_extent().transformed(ax.transData.inverted())
    assert ax.get_xlim()[0] < box.x0 and box.x1 < -31.0


def test_the_name_that_is_told_is_the_stated_one_whatever_its_form() -> None:
    found = mismatch("missing_physics").explanation
    told = replace(found.causes[0], effect="headwind", found_as="brake_fade", likeness=(("headwind", 1.0),))
    (ax,) = error_figures.ranking(replace(found, ranking=RANKING, causes=(told,))).axes
    tones = [to_hex(bar.get_facecolor()) for bar in ax.patches[1:-1]]
    assert [tone == BLUE.lower() for tone in tones] == [False, False, True, False]  # by their nats


def test_what_lies_far_below_is_cut_with_an_arrow() -> None:
    found = mismatch("missing_physics")
    ranking = (*RANKING, ("turbo_lag", -900.0))
    (ax,) = error_figures.ranking(replace(found.explanation, ranking=ranking)).axes
    assert "← -900" in [t.get_text() for t in ax.texts]


def test_rejected_names_stand_by_their_nats() -> None:
    found = mismatch("missing_physics")
    x = replace(found.explanation, ranking=RANKING)
    gained, _ = page_text.rejected_names(replace(found, explanation=x))
    assert [g.name for g in gained] == ["headwind"]  # dragging brake is in the group


def test_what_is_suspected_is_not_said_to_have_gained_nothing() -> None:
    found = mismatch("missing_physics")
    _, before = page_text.rejected_names(found)
    suspected = replace(found.result, suspicions=(Suspicion("road_grade", 30.4, "drive it both ways"),))
    _, after = page_text.rejected_names(replace(found, result=suspected))
    assert set(before) - set(after) == {"road grade"}


def test_names_that_a_parameter_is_not_told_from_are_not_drawn_as_rejected() -> None:
    found = mismatch("missing_physics").explanation
    off = Cause("parameter_error", "mass", 60.0, 1.0, found.causes[0].force, rivals=(("headwind", 1.0),))
    assert "headwind" in off.not_told_from
    (ax,) = error_figures.ranking(replace(found, ranking=RANKING, causes=(off,))).axes
    tones = [to_hex(bar.get_facecolor()) for bar in ax.patches[1:-1]]
    assert [tone == SKY.lower() for tone in tones] == [False, False, True, False]


def test_the_least_evidence_is_what_was_asked_for() -> None:
    """Half of it is, where held-out drives show that something differs."""
    found = mismatch("missing_physics")
    rules = replace(found.explanation.model.rules, least_gain=10.0)
    x = replace(
        found.explanation, ranking=RANKING, model=replace(found.explanation.model, rules=rules), causes=()
    )
    (ax,) = error_figures.ranking(x).axes
    (least,) = [t for t in ax.texts if "least evidence" in t.get_text()]
    assert least.get_position()[0] == 10.0
    gained, _ = page_text.rejected_names(replace(found, explanation=x))
    assert not any("too little evidence" in str(g) for g in gained)
