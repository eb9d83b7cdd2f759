"""What acts at a time of its own predicts blocks of its drives that its fit has not seen; noise does not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from deeptruck_model.mismatch.finding import Finding
from deeptruck_model.mismatch.mechanisms import LIBRARY, CandidateTerm, is_time_varying
from deeptruck_model.mismatch.posterior import windows
from deeptruck_model.mismatch.posterior.explain import explain
from deeptruck_model.mismatch.posterior.left_out import BLOCK_S, LeftOut, left_out, of_its_time
from deeptruck_model.mismatch.posterior.search import Search
from deeptruck_model.mismatch.report.findings import from_cause
from deeptruck_model.mismatch.residual.evidence import Evidence

TIME = np.arange(6000) * 0.2
GUSTS = -0.06 * np.sin(2.0 * np.pi * TIME / 90.0)  # m/s^2
STUCK = -0.25 * sum(np.abs(TIME - middle) < 4.0 for middle in (200.0, 300.0, 801.0, 1000.0))


def blown(e: Evidence) -> CandidateTerm:
    """The first term of the wind that varies in time."""
    return next(t for t in Search(e).candidate_terms(LIBRARY["headwind"]) if is_time_varying(t))


def judged(e: Evidence, term: CandidateTerm) -> LeftOut | None:
    return left_out(e, Search(e).model((term,), frozenset()), term)


def test_gusts_predict_blocks_that_were_left_out(nothing_missing: Evidence) -> None:
    e = replace(nothing_missing, residual=nothing_missing.residual + GUSTS)
    found = judged(e, blown(e))
    assert found is not None and found.shown
    assert found.with_it < found.without and found.blocks > 600.0 / BLOCK_S
    explained = 1.0 - (found.with_it / found.without) ** 2
    assert explained > 0.5 * np.mean(GUSTS**2) / found.without**2


def test_knots_that_follow_noise_predict_nothing(nothing_missing: Evidence) -> None:
    found = judged(nothing_missing, blown(nothing_missing))
    assert found is not None and not found.shown


def test_a_cause_in_windows_is_shown_where_it_acts(nothing_missing: Evidence) -> None:
    e = replace(nothing_missing, residual=nothing_missing.residual + STUCK)
    x = explain(Search(e))
    term = x.causes[0].term
    assert term is not None and of_its_time(term)
    found = left_out(e, x.model, term)
    assert found is not None and found.shown and found.blocks < 30
    finding = from_cause(replace(x.causes[0], left_out=found), e, x, {})
    assert "blocks of 5 s left out of the same drives" in str(finding.says)
    again = Finding.read(finding.to_json())
    assert again.left_out is not None
    assert again.left_out.with_it == pytest.approx(found.with_it, abs=1e-4)


def test_one_short_event_is_too_little_to_tell(nothing_missing: Evidence) -> None:
    e = nothing_missing
    always = Search(e).candidate_terms(LIBRARY["dragging_brake"])[0]
    assert judged(e, windows.during(always, [(0, 301.0, 304.0)], e)) is None
