"""A force that is time-varying as no known one does is unknown; one that acts as a wind does is a wind."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from deeptruck_model.mismatch.mechanisms import LIBRARY, candidate_terms, is_time_varying
from deeptruck_model.mismatch.posterior.candidates import enriched
from deeptruck_model.mismatch.posterior.causes import Explanation
from deeptruck_model.mismatch.posterior.explain import explain
from deeptruck_model.mismatch.posterior.search import Search
from deeptruck_model.mismatch.report.findings import from_cause
from deeptruck_model.mismatch.residual.evidence import Evidence

ROADS = ("road_grade", "road_surface")


def swell(e: Evidence) -> np.ndarray:
    """Something that is time-varying within minutes, rms 1."""
    return np.sqrt(2.0) * np.sin(2.0 * np.pi * np.arange(len(e)) * e.dt / 170.0)


@pytest.fixture(scope="module")
def pushed(nothing_missing: Evidence) -> Explanation:
    """A force of either sign that does not care about speed, on a truck that drives from 3 to 24 m/s."""
    speed = 13.5 + 10.5 * np.sin(np.arange(len(nothing_missing)) * nothing_missing.dt / 40.0)
    signals = nothing_missing.signals | {"speed": speed, "drag": 1e-4 * speed**2}
    e = replace(
        nothing_missing,
        signals=signals,
        residual=nothing_missing.residual + 0.08 * swell(nothing_missing),
    )
    return explain(Search(e, exclude=ROADS))


def test_a_push_that_does_not_care_about_speed_is_no_wind(pushed: Explanation) -> None:
    assert [c.effect for c in pushed.causes] == ["unknown"]
    cause = pushed.causes[0]
    assert cause.time_varying and not cause.predictable and cause.nearest is not None


def test_it_is_told_with_the_nearest_name(pushed: Explanation, nothing_missing: Evidence) -> None:
    told = from_cause(pushed.causes[0], nothing_missing, pushed, {})
    assert pushed.causes[0].nearest in str(told.says) and told.nearest == pushed.causes[0].nearest
    assert np.corrcoef(pushed.causes[0].force, swell(nothing_missing))[0, 1] > 0.9


def test_a_wind_is_a_wind(nothing_missing: Evidence) -> None:
    e = nothing_missing
    gusts = -4.0 * swell(e) * 2.0 * e["drag"] / e["speed"]
    found = explain(Search(replace(e, residual=e.residual + gusts), exclude=ROADS))
    assert found.causes and found.causes[0].effect != "unknown"
    assert "headwind" in {found.causes[0].effect, *found.causes[0].not_told_from}
    names = [name for name, _ in found.causes[0].rivals]
    assert len(names) == len(set(names))


@pytest.mark.long
def test_what_would_be_a_storm_that_turns_within_a_minute_is_no_wind(nothing_missing: Evidence) -> None:
    """A slope sensor that was off had been called winds of 26 m/s ahead and 20 m/s behind."""
    e = nothing_missing
    storm = -20.0 * swell(e) * 2.0 * e["drag"] / e["speed"]
    found = explain(Search(replace(e, residual=e.residual + storm), exclude=ROADS))
    assert found.causes and "headwind" not in {found.causes[0].effect, *found.causes[0].not_told_from}


@pytest.mark.long
def test_a_push_that_goes_by_time_alone_may_be_a_slope(nothing_missing: Evidence) -> None:
    search = Search(
        replace(nothing_missing, residual=nothing_missing.residual + 0.08 * swell(nothing_missing))
    )
    (cause,) = explain(search).causes
    assert "road_grade" in {cause.effect, *cause.not_told_from}


def test_a_climb_that_was_not_recorded_may_be_one_and_the_same(nothing_missing: Evidence) -> None:
    """And it is not widened by what varies in time, which would have to pay for that."""
    climbing = replace(nothing_missing, residual=nothing_missing.residual - 9.81 * 0.03)
    found = explain(Search(climbing))
    assert "road_grade" in {found.causes[0].effect, *found.causes[0].not_told_from}
    levelled = replace(climbing, signals=climbing.signals | {"grade": np.zeros(len(climbing))})
    steady = {
        seen: [t for t in candidate_terms(LIBRARY["road_grade"], e) if not is_time_varying(t)]
        for seen, e in (("no slope", climbing), ("a slope", levelled))
    }
    assert len(steady["no slope"]) == 1 and not steady["a slope"]
    search = Search(climbing)
    base = search.background(())
    alone = search.model(tuple(steady["no slope"]), base.free, base.fit)
    assert not is_time_varying(enriched(search, alone).named[-1])
