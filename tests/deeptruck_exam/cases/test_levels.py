"""Which laws the levels hide: all that suit, in an order of their own."""

from __future__ import annotations

import numpy as np
import pytest

from deeptruck_exam.cases.levels import (
    LEVELS,
    NO_EFFECT,
    NOT_RECORDED,
    SLOPE_OR_WIND,
    choose,
    hidden_input,
    mark,
    suitable,
)
from deeptruck_exam.cases.plan import draw_plan
from deeptruck_exam.worlds import trucks


@pytest.mark.parametrize("level", LEVELS)
def test_plans_of_every_level(level: str) -> None:
    plans = [draw_plan(level, seed, None, "physics", 4.0) for seed in range(60)]
    assert all(p.truck in e.trucks for p in plans for e in p.effects)
    off = [
        np.ptp([p.simulator_values.get(n, 1.0) / p.values.get(n, 1.0) for n in trucks.TUNABLE]) for p in plans
    ]
    assert (np.median(off) > 0.05) == (level in ("wrong_parameters", "absorbed", "only_parameters"))
    if level == "nothing_missing":
        assert all(not p.effects for p in plans) and 0.0 < max(off) < 0.03
    elif level == "only_parameters":
        assert not any(p.effects for p in plans)
    elif level == "input_not_recorded":
        assert {p.hidden_input for p in plans} == set(NOT_RECORDED)
    else:
        assert len({p.effects[0].key for p in plans}) >= 3
    if level == "several":
        assert {len(p.effects) for p in plans} == {2, 3}
        assert all(len({e.name for e in p.effects}) == len(p.effects) for p in plans)
    if level == "unknown":
        assert {bool(p.excluded) for p in plans} == {True, False}
        assert all(p.excluded or p.effects[0].name == "unknown" for p in plans)


@pytest.mark.parametrize(
    "level", [n for n in LEVELS if n not in (*NO_EFFECT, "input_not_recorded", "unknown")]
)
def test_a_level_goes_through_all_that_suit_in_its_own_order(level: str) -> None:
    some = suitable(level)
    chosen = [choose(level, 1000 + k, None)[0][0].key for k in range(len(some))]
    assert sorted(chosen) == sorted(e.key for e in some)


def test_one_seed_hides_other_laws_at_other_levels() -> None:
    assert len({mark(level) for level in LEVELS}) == len(LEVELS)
    for seed in (0, 7, 100_003):
        chosen = [choose(level, seed, None)[0] for level in LEVELS if level not in SLOPE_OR_WIND]
        keys = [some[0].key for some in chosen if some]
        assert len(set(keys)) >= len(keys) - 2


def test_each_input_is_withheld_in_turn() -> None:
    assert [hidden_input("input_not_recorded", k) for k in range(4)] == list(NOT_RECORDED)
    assert hidden_input("noise", 1) == ""
