"""Over many weeks false discoveries stay below the stated rate, and the same input is tested once."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from deeptruck_model.fleet.pool import SERIES, advance
from deeptruck_model.fleet.statistics import Seen, discovered, level_of_batch, siblings
from deeptruck_model.fleet.storage import place

WEEKS, FLEETS = 12, 20


def receipts(keys: dict[str, str], simulator: str = "truck:trucksim") -> dict[str, dict[str, object]]:
    return {t: {"simulator": simulator, "key": k, "weeks": {"2026-W10": 0.01}} for t, k in keys.items()}


def test_what_is_discovered_is_not_tested_again_and_equal_input_is_no_new_test(tmp_path):
    target = place(str(tmp_path))
    first = advance(target, {"a": 0.001, "b": 0.5}, receipts({"a": "1", "b": "1"}), 0.05)
    assert [b["discovered"] for b in first] == [["a"]]
    content = target.read(SERIES)
    assert advance(target, {"a": 0.001, "b": 0.5}, receipts({"a": "1", "b": "1"}), 0.05) == first
    assert target.read(SERIES) == content
    both = advance(target, {"a": 0.001, "b": 0.02}, receipts({"a": "2", "b": "2"}), 0.05)
    assert list(both[-1]["p"]) == ["b"] and both[:-1] == first
    assert both[-1]["level"] == pytest.approx(level_of_batch(0.05, 2, 1, 1))
    assert both[-1]["discovered"] == []


def test_another_simulator_or_level_begins_anew_and_keeps_the_earlier_series(tmp_path):
    target = place(str(tmp_path))
    first = advance(target, {"a": 0.001}, receipts({"a": "1"}), 0.05)
    for other in ({"simulator": "truck:volvo"}, {}):
        level = 0.05 if other else 0.1
        again = advance(target, {"a": 0.001}, receipts({"a": "3"}, **other), level)
        assert len(again) == 1 and again[0]["level"] == pytest.approx(level_of_batch(level, 1, 1, 0))
    kept = target.read_json(SERIES)["series"]
    assert len(kept) == 3 and kept[0]["batches"] == first


def test_levels_of_a_series_without_discoveries_add_up_to_the_whole():
    levels = [level_of_batch(0.05, k, 10, 0) for k in range(1, 200_000)]
    assert 0.0499 < sum(levels) < 0.05 and levels == sorted(levels, reverse=True)


def weekly(rng: np.random.Generator, trucks: int, affected: int, folder: Path) -> tuple[int, int, int]:
    """False and true discoveries of a series of weeks in which each truck's evidence grows, and the false
    ones of a look at the full level every week."""
    target = place(str(folder))
    nats = np.zeros((trucks, 2))
    every: set[str] = set()
    for week in range(WEEKS):
        more = 0.5 * rng.chisquare(1, (trucks, 2)) - 1.0
        more[:affected] += rng.uniform(1.0, 4.0, (affected, 1))
        nats += more
        seen = {str(k): Seen({"drag_area": a}, {"drag_area": b}, 1.0) for k, (a, b) in enumerate(nats)}
        tested = {n: t.p for n, t in siblings(seen, {}).items() if t.p is not None}
        advance(target, tested, receipts(dict.fromkeys(tested, str(week))), 0.1)
        names = list(tested)
        every |= {names[k] for k in np.flatnonzero(discovered(list(tested.values()), 0.1))}
    found = {t for s in target.read_json(SERIES)["series"] for b in s["batches"] for t in b["discovered"]}
    wrong = {t for t in found if int(t) >= affected}
    return len(wrong), len(found - wrong), sum(int(t) >= affected for t in every)


@pytest.mark.parametrize(("trucks", "affected", "power"), [(120, 0, 0.0), (120, 12, 0.3), (300, 12, 0.5)])
def test_over_a_series_of_weeks_the_false_stay_below_the_level(trucks, affected, power, tmp_path):
    """At 0.1; three standard errors are allowed for. Looks at the full level every week have more. Few
    references have no p that is small enough for later weeks, so that power is lost."""
    rng = np.random.default_rng(7)
    series = [weekly(rng, trucks, affected, tmp_path / str(k)) for k in range(FLEETS)]
    rate = np.mean([wrong / max(wrong + right, 1) for wrong, right, _ in series])
    every_week = np.mean([wrong / max(wrong + right, 1) for _, right, wrong in series])
    found = np.mean([right / max(affected, 1) for _, right, _ in series])
    assert rate <= 0.1 + 3.0 * np.sqrt(0.1 * 0.9 / len(series)) and rate < every_week
    assert found >= power
