"""Windows in time that share their places are stretches of road."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

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
    best = best_of(passed)
    (stretch,) = best.named[-1].variant.places
    assert np.allclose(stretch, SOFT, atol=10.0)
    force = best.named[-1].columns @ best.coefficients(best.effects[-1])
    assert force.min() == pytest.approx(-FORCE, rel=0.1) and best.named[-1].variant.comes_again
    both = by_place.instead(Search(passed), Search(passed).background(()), best.named[-1])
    assert {m.effects[-1] for m in both} == {"road_surface", "road_grade"}


@pytest.mark.parametrize("nowhere", [-1.0, 1e5], ids=["without a place", "on a road of its own"])
def test_a_drive_that_meets_no_other_has_it_in_its_own_time(passed: Evidence, nowhere: float) -> None:
    """The second drive passes twice here; of the first nobody knows where it was, or it was elsewhere."""
    e = passed
    again = (e["place"] >= 4000.0) & (e["place"] < 4300.0) & (e.record == 1)
    elsewhere = np.full(len(e), nowhere) if nowhere < 0.0 else nowhere + e["place"]
    place = np.where(e.record == 0, elsewhere, np.where(again, e["place"] - 2500.0, e["place"]))
    lost = replace(e, signals=e.signals | {"place": place}, residual=e.residual - FORCE * again)
    best = best_of(lost)
    *along, alone = best.named[-1].variant.parts
    soft = (e["place"] >= SOFT[0]) & (e["place"] < SOFT[1]) & (e.record == 0)
    ((record, first, last),) = alone.spans
    assert record == 0 and all(part.places for part in along)
    assert np.allclose([first, last], [e["elapsed"][soft].min(), e["elapsed"][soft].max()], atol=0.5)
    force = best.named[-1].columns @ best.coefficients(best.effects[-1])
    assert np.median(force[soft]) == pytest.approx(-FORCE, rel=0.1)
    assert (
        best.named[-1].parts[-1].name
        == f"{best.named[-1].parts[0].name.split('[')[0]}[a, {first:.0f} to {last:.0f} s]"
    )


def test_a_drive_that_meets_but_what_is_held_out_has_it_in_its_own_time(passed: Evidence) -> None:
    """The third drive, held out, is on the road of the first; the second passes its own one twice."""
    e = passed
    last = e.record == 1
    again = (e["place"] >= 4000.0) & (e["place"] < 4300.0) & last
    place = np.where(last, np.where(again, e["place"] - 2500.0, e["place"]), 1e5 + e["place"])
    held = last & (e["elapsed"] > 480.0)
    first, second = e.stretches
    begin = int(np.flatnonzero(held)[0])
    parts = (first, replace(second, stop=begin), Stretch("c", begin, len(e), 0.0, True))
    place = np.where(held, 1e5 + SOFT[0] + np.arange(len(e)) % 300, place)
    given = replace(
        e, stretches=parts, signals=e.signals | {"place": place}, residual=e.residual - FORCE * again
    )
    assert [record for record, *_ in best_of(given).named[-1].variant.parts[-1].spans] == [0]


def test_the_ends_are_told_to_a_metre(passed: Evidence) -> None:
    e = passed
    soft = (e["place"] >= 1403.0) & (e["place"] < 1667.0)
    ((begin, end),) = by_place.stretches(e, np.where(soft, -FORCE, 0.0) + 0.001 * np.sin(np.arange(len(e))))
    assert begin == pytest.approx(1403.0, abs=3.0) and end == pytest.approx(1667.0, abs=3.0)


def test_where_nothing_stands_out_there_is_no_candidate(nothing_missing: Evidence) -> None:
    search = Search(nothing_missing)
    assert by_place.candidates(search, search.background(())) == []


def best_of(e: Evidence) -> Model:
    search = Search(e)
    return max(by_place.candidates(search, search.background(())), key=lambda m: m.score)
