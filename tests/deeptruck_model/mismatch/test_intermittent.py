"""What acts now and then alone: planted in noise of the same kind as everything else."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from deeptruck_model.mismatch import intermittent
from deeptruck_model.mismatch.evidence import Evidence
from deeptruck_model.mismatch.explain import explain
from deeptruck_model.mismatch.findings import from_cause
from deeptruck_model.mismatch.search import Search

TIME = np.arange(6000) * 0.2
STUCK = ((TIME > 300) & (TIME < 306)) | ((TIME > 801) & (TIME < 809))


@pytest.fixture(scope="module")
def stuck(nothing_missing: Evidence) -> Evidence:
    return replace(nothing_missing, residual=nothing_missing.residual - 0.25 * STUCK)


def test_noise_alone_has_no_windows(nothing_missing: Evidence) -> None:
    search = Search(nothing_missing)
    assert intermittent.windows(nothing_missing, search.background(())) == []


def test_the_windows_are_where_the_brake_sticks(stuck: Evidence) -> None:
    spans = intermittent.windows(stuck, Search(stuck).background(()))
    marked = np.zeros(len(stuck), dtype=bool)
    for i, first, last in spans:
        marked |= (stuck.record == i) & (stuck["elapsed"] >= first) & (stuck["elapsed"] <= last)
    assert marked[STUCK].mean() > 0.9 and marked[~STUCK].mean() < 0.02


def test_what_sticks_now_and_then_is_named_and_acts_nowhere_else(stuck: Evidence) -> None:
    found = explain(Search(stuck))
    assert found.causes and found.causes[0].shape is not None and "when" in found.causes[0].shape.settings
    names = {found.causes[0].effect, *found.causes[0].not_told_from}
    assert "dragging_brake" in names
    assert "seen now and then alone" in from_cause(found.causes[0], stuck, found, {}).data["says"]
    near = np.convolve(STUCK, np.ones(61), mode="same") > 0
    assert np.abs(found.causes[0].force[~near]).max() < 1e-9
