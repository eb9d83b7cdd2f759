"""Windows in time that share their places are stretches of road."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from deeptruck_model.mismatch.mechanisms.variants import Span
from deeptruck_model.mismatch.posterior import by_place
from deeptruck_model.mismatch.posterior.search import Model, Search
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
    assert np.allclose(by_place.stretches(passed, passed.residual), [SOFT], atol=10.0)


def test_what_one_pass_finds_alone_is_no_place(passed: Evidence) -> None:
    """The other one leaves the opposite there."""
    other = np.where(passed.record == 1, -passed.residual, passed.residual)
    assert by_place.stretches(passed, other) == ()


def test_up_and_down_are_two_stretches(passed: Evidence) -> None:
    hump = np.where((passed["place"] >= 1800.0) & (passed["place"] < 2000.0), FORCE, 0.0)
    found = by_place.stretches(passed, passed.residual + hump)
    assert np.allclose(found, [SOFT, (1800.0, 2000.0)], atol=10.0)


def test_what_is_held_out_finds_no_stretch(passed: Evidence) -> None:
    held = replace(passed, stretches=(passed.stretches[0], replace(passed.stretches[1], held_out=True)))
    assert by_place.stretches(held, held.residual) == ()


def test_it_is_either_name_of_the_road(passed: Evidence) -> None:
    best = best_of(passed, [])
    (stretch,) = best.named[-1].variant.places
    assert np.allclose(stretch, SOFT, atol=10.0)
    force = best.named[-1].columns @ best.coefficients(best.effects[-1])
    assert force.min() == pytest.approx(-FORCE, rel=0.1) and best.named[-1].variant.comes_again
    both = by_place.instead(Search(passed), Search(passed).background(()), best.named[-1])
    assert {m.effects[-1] for m in both} == {"road_surface", "road_grade"}


def test_a_drive_without_a_place_has_it_in_its_own_windows(passed: Evidence) -> None:
    """The second drive passes twice here; of the first nobody knows where it was."""
    e = passed
    again = (e["place"] >= 4000.0) & (e["place"] < 4300.0) & (e.record == 1)
    place = np.where(e.record == 0, -1.0, np.where(again, e["place"] - 2500.0, e["place"]))
    lost = replace(e, signals=e.signals | {"place": place}, residual=e.residual - FORCE * again)
    seen = spans(e, (0, *SOFT), (1, *SOFT), (1, 4000.0, 4300.0))
    best = best_of(lost, seen)
    assert best.named[-1].variant.places and best.named[-1].variant.parts[-1].spans == (seen[0],)
    assert (
        np.allclose(best.coefficients(best.effects[-1])[-1], FORCE, rtol=0.1)
        or best.effects[-1] == "road_grade"
    )


def test_where_nothing_stands_out_there_is_no_candidate(nothing_missing: Evidence) -> None:
    search = Search(nothing_missing)
    assert by_place.candidates(search, search.background(()), []) == []


def best_of(e: Evidence, seen: list[Span]) -> Model:
    search = Search(e)
    return max(by_place.candidates(search, search.background(()), seen), key=lambda m: m.score)
