"""Names read from draws that were made by hand."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from deeptruck_model.mismatch.names import Explanation, Names, names
from deeptruck_model.mismatch.rules import Rules
from deeptruck_model.mismatch.tree import SLOW

DRAWS = 100
RULES = Rules()
LAG, FADE, WIND, DRAG = "brake_lag", "brake_fade", "headwind", "drag_area"
OTHERS = ("turbo_lag", "payload_change", "command_delay", "load_slosh")


@dataclass
class Draws:
    """A posterior by the draws in which each name is in, and what may act in the place of each name."""

    shares: Mapping[str, slice]
    places: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    known_physics: bool = True

    @property
    def of(self) -> list[Any]:
        return [SimpleNamespace(name=n) for n in (*self.shares, SLOW)]

    @property
    def search(self) -> Any:
        return SimpleNamespace(own=None, rules=RULES, e=SimpleNamespace(known_physics=self.known_physics))

    def inside(self, name: str) -> np.ndarray:
        out = np.zeros(DRAWS, dtype=bool)
        out[self.shares.get(name, slice(0))] = True
        return out

    def in_place_of(self, name: str, beside: Sequence[str]) -> tuple[Mapping[str, float], float]:
        return self.places.get(name, {name: 1.0}), float(self.inside(name).mean())

    def gain(self, name: str) -> float:
        return 10.0

    def force(self, name: str, given: np.ndarray) -> np.ndarray:
        assert given.any()
        return np.zeros(3)


def of(shares: Mapping[str, slice], **more: Any) -> Names:
    return names(Draws(shares, **more))  # type: ignore[arg-type]


def test_where_nothing_is_in_nothing_is_named() -> None:
    found = of({LAG: slice(0), WIND: slice(0)})
    assert (found.found, found.each) == ((), {})
    assert found.explanations == (Explanation((), 1.0),)


@pytest.mark.parametrize(("draws", "said"), [(49, False), (50, True), (100, True)])
def test_a_name_is_said_from_one_half_on(draws: int, said: bool) -> None:
    found = of({LAG: slice(draws), WIND: slice(0)})
    assert [x.name for x in found.found] == [LAG] * said
    assert found.each[LAG] == pytest.approx(draws / DRAWS)
    if said:
        assert found.found[0].tree.names == {LAG: pytest.approx(draws / DRAWS)}


def test_what_is_in_hardly_any_draw_is_left_out() -> None:
    found = of({LAG: slice(100), WIND: slice(1)})
    assert found.each == {LAG: 1.0}
    assert found.explanations == (Explanation((LAG,), 0.99), Explanation((LAG, WIND), 0.01))


@pytest.mark.parametrize(("lag", "first"), [(96, LAG), (90, WIND)])
def test_names_are_in_the_order_of_their_families_probability(lag: int, first: str) -> None:
    """Two of one family in turn are in as often as the family is, 95 %."""
    shares = {LAG: slice(0, lag), WIND: slice(0, 50), DRAG: slice(50, 95)}
    assert of(shares, places={WIND: {WIND: 0.6, DRAG: 0.4}}).found[0].name == first


def test_where_every_name_was_looked_at_and_none_is_probable_enough_nothing_is_found() -> None:
    assert of({WIND: slice(60)}, places={WIND: {WIND: 0.5}}).found == ()


def test_a_name_that_stands_in_its_place_is_no_finding_of_its_own() -> None:
    (one,) = of({LAG: slice(0, 50), FADE: slice(50, 100)}, places={LAG: {LAG: 0.6, FADE: 0.4}}).found
    assert one.tree.names == {LAG: pytest.approx(0.3), FADE: pytest.approx(0.2)}


def test_a_name_that_is_in_at_once_is_a_finding_of_its_own() -> None:
    both = of({LAG: slice(0, 100), FADE: slice(0, 100)}, places={LAG: {LAG: 0.7, FADE: 0.3}})
    assert [x.name for x in both.found] == [LAG, FADE]
    assert both.found[0].tree.names == {LAG: pytest.approx(0.7), FADE: pytest.approx(0.3)}


@pytest.mark.parametrize(
    ("known", "share", "accepted"), [(True, 60, True), (False, 60, False), (False, 95, True)]
)
def test_beside_a_learned_simulator_only_what_is_sure_is_accepted(
    known: bool, share: int, accepted: bool
) -> None:
    (one,) = of({LAG: slice(share)}, known_physics=known).found
    assert one.accepted is accepted


def test_no_more_names_than_a_verdict_may_have() -> None:
    found = of(dict.fromkeys((LAG, WIND, *OTHERS), slice(100)))
    assert len(found.found) == RULES.most_findings
    assert len(found.each) == 6


def test_slow_drift_is_no_name() -> None:
    found = of({SLOW: slice(80), LAG: slice(0)})
    assert (found.found, found.each) == ((), {})
