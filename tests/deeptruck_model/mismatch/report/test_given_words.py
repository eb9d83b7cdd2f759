"""What was given, in the page's words."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from found_mismatches import mismatch, recording
from pages import Page

from deeptruck_model.mismatch.data.prepared import SAME_DRIVES, prepare, with_held_out
from deeptruck_model.mismatch.finding import Suspicion
from deeptruck_model.mismatch.report import given, page, timeline_figure
from deeptruck_model.mismatch.report.figures import draw
from deeptruck_model.mismatch.report.what_now import Asked
from deeptruck_model.mismatch.report.wording import counted
from deeptruck_model.mismatch.result import Bound, Regime


def compared(count: int, seconds: float, evidence: bool = True) -> Any:
    pieces, flags, _ = with_held_out([recording(k, seconds) for k in range(count)], [], 0.1)
    prepared = tuple(prepare(r, True) for r in pieces)
    stretches = tuple(SimpleNamespace(held_out=out) for out in flags)
    return SimpleNamespace(
        prepared=prepared, evidence=SimpleNamespace(stretches=stretches) if evidence else None
    )


@pytest.mark.parametrize(
    ("count", "seconds", "said"),
    [
        (1, 420.0, "1 recording, 7 min, the last 30 % of it held out for judging."),
        (2, 420.0, "2 recordings, 14 min together, the last 30 % of each held out for judging."),
        (2, 120.0, "2 recordings, 4 min together."),
        (5, 120.0, "5 recordings, 10 min together, 2 of them held out for judging."),
    ],
)
def test_what_was_given_is_counted_and_not_its_parts(count: int, seconds: float, said: str) -> None:
    assert given.summary(compared(count, seconds)) == said


def test_where_nothing_is_compared_the_parts_are_no_recordings_either() -> None:
    assert given.summary(compared(1, 420.0, evidence=False)) == "1 recording, 7 min."


def test_a_recording_that_was_cut_in_two_is_drawn_as_one() -> None:
    (whole,) = given.as_given(compared(1, 420.0).prepared)
    assert (len(whole), whole.name) == (4200, recording(0).name)
    assert np.all(whole.channels["grade"] == recording(0, 420.0).channels["grade"])
    assert len(timeline_figure.tracks(compared(2, 420.0, evidence=False))) == 2


@pytest.mark.parametrize(("kind", "said"), [("undetermined", False), ("nothing_missing", True)])
def test_nothing_is_said_of_claims_where_there_is_none(kind: str, said: bool) -> None:
    found = mismatch(kind)
    found = replace(found, result=replace(found.result, caveats=(SAME_DRIVES, *found.result.caveats)))
    text = " ".join(Page(page.page(found, {}, Asked(Path("found")))).text)
    assert ("what is claimed holds" in text) is said


def test_one_free_run_is_one() -> None:
    assert (counted(1, "free run"), counted(2, "free run")) == ("1 free run", "2 free runs")
    found = mismatch("missing_physics")
    found = replace(found, result=replace(found.result, fit=replace(found.result.fit, windows=1)))
    assert "1 free run of 20 s" in " ".join(Page(page.page(found, {}, Asked(Path("found")))).text)
    alone = {n: replace(e, **{k: v[:1] for k, v in vars(e).items()}) for n, e in found.errors.items()}
    assert "of 1 free run on" in draw(replace(found, errors=alone))["errors"].caption


def test_what_is_suspected_is_asked_for_before_any_tour() -> None:
    """After half an hour of driving the page had asked for two tours of ten minutes."""
    found = mismatch("undetermined")
    suspected = Suspicion("shift_interruption", 62.0, "accelerate through all gears at full torque")
    doubtful = replace(found, result=replace(found.result, suspicions=(suspected, suspected)))
    (asked,) = given.record_next(doubtful)
    assert asked == "To tell whether it is shift interruption: accelerate through all gears at full torque."
    (tours,) = given.record_next(replace(found, result=replace(found.result, suspicions=())))
    assert given.TOURS in tours


def test_no_leaf_of_a_tree_is_asked_for_as_a_drive() -> None:
    """The page had asked for drives 'with brake force per mass above 0.891 m/s^2 and grade below -0.0015'."""
    found = mismatch("missing_physics")
    fit = replace(found.result.fit, validated=False)
    for bounds, said in ((1, "speed above 20"), (2, "the conditions in which it acts")):
        one = Regime((Bound("speed", 20.0, np.inf, "m/s"),) * bounds, 0.7, 0.2)
        asked = given.record_next(replace(found, result=replace(found.result, fit=fit, regimes=(one,))))
        assert any("more separate drives, held out" in a and said in a for a in asked)
