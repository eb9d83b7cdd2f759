"""Windows in time that share their places are stretches of road."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from deeptruck_model.mismatch.mechanisms.variants import Span
from deeptruck_model.mismatch.posterior import by_place
from deeptruck_model.mismatch.posterior.search import Search
from deeptruck_model.mismatch.residual.evidence import Evidence, Stretch

FORCE = 0.2  # m/s^2
SOFT = (1500.0, 1800.0)  # m


@pytest.fixture(scope="module")
def passed(nothing_missing: Evidence) -> Evidence:
    """Two drives over one road, none held out, of which a stretch is soft."""
    e = nothing_missing
    stretches = (Stretch("a", 0, 3000, 0.0, False), Stretch("b", 3000, len(e), 0.0, False))
    soft = (e["place"] >= SOFT[0]) & (e["place"] < SOFT[1])
    return replace(e, stretches=stretches, residual=e.residual - FORCE * soft)


def spans(e: Evidence, *places: tuple[int, float, float]) -> list[Span]:
    """Of recordings, from and to a place."""
    out = []
    for record, first, last in places:
        rows = (e.record == record) & (e["place"] >= first) & (e["place"] < last)
        out.append((record, float(e["elapsed"][rows].min()), float(e["elapsed"][rows].max())))
    return out


def test_a_stretch_is_what_most_passes_find(passed: Evidence) -> None:
    both = spans(passed, (0, *SOFT), (1, *SOFT), (1, 4000.0, 4200.0))
    ((first, last),) = by_place.stretches(passed, both)
    assert abs(first - SOFT[0]) <= 10.0 and abs(last - SOFT[1]) <= 10.0
    assert by_place.stretches(passed, both[:1]) == ()


def test_what_is_held_out_finds_no_stretch(passed: Evidence) -> None:
    held = replace(passed, stretches=(passed.stretches[0], replace(passed.stretches[1], held_out=True)))
    assert by_place.stretches(held, spans(passed, (0, *SOFT), (1, *SOFT))) == ()


def test_what_a_shift_hides_of_a_pass_is_filled(passed: Evidence) -> None:
    seen = spans(passed, (0, 1500.0, 1600.0), (0, 1640.0, 1800.0), (1, 1500.0, 1620.0), (1, 1660.0, 1800.0))
    search = Search(passed)
    models = by_place.candidates(search, search.background(()), seen)
    best = max(models, key=lambda m: m.score)
    (stretch,) = best.named[-1].variant.places
    assert np.allclose(stretch, SOFT, atol=10.0)
    assert best.effects[-1] in ("road_surface", "road_grade")
    force = best.named[-1].columns @ best.coefficients(best.effects[-1])
    assert force.min() == pytest.approx(-FORCE, rel=0.1) and best.named[-1].variant.comes_again


def test_windows_without_a_place_give_no_candidate(passed: Evidence) -> None:
    search = Search(passed)
    assert by_place.candidates(search, search.background(()), spans(passed, (0, 700.0, 800.0))) == []
