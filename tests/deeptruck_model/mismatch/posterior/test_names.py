"""Names and their tree, read from draws."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from deeptruck_model.mismatch.mechanisms import LIBRARY
from deeptruck_model.mismatch.mechanisms.families import FAMILY, PARAMETER_ERRORS, ROOT, SLOW, UNKNOWN
from deeptruck_model.mismatch.posterior.names import Explanation, Names, Tree, names
from deeptruck_model.mismatch.residual.gather import REFIT_PARAMETERS
from deeptruck_model.mismatch.rules import Rules

DRAWS = 100
RULES = Rules()
LAG, FADE, WIND, DRAG = "brake_lag", "brake_fade", "headwind", "drag_area"
OTHERS = ("turbo_lag", "payload_change", "command_delay", "load_slosh")


@dataclass
class Draws:
    """A posterior by the draws in which each name acts, and in which it does so in events alone."""

    shares: Mapping[str, slice]
    events: Mapping[str, slice] = field(default_factory=dict)
    known_physics: bool = True
    forces: Mapping[str, float] = field(default_factory=dict)

    @property
    def of(self) -> list[Any]:
        return [SimpleNamespace(name=n) for n in (*self.shares, SLOW)]

    @property
    def regression(self) -> Any:
        whole = SimpleNamespace(adds_up=lambda force, horizon_s, where_it_acts: np.abs(force).max())
        e = SimpleNamespace(known_physics=self.known_physics, everywhere=lambda: whole)
        return SimpleNamespace(reference=None, rules=RULES, e=e, library=())

    def inside(self, name: str) -> np.ndarray:
        out = np.zeros(DRAWS, dtype=bool)
        out[self.shares.get(name, slice(0))] = True
        return out

    def lasts(self, name: str) -> np.ndarray:
        out = self.inside(name)
        out[self.events.get(name, slice(0))] = False
        return out

    def gain(self, name: str) -> float:
        return 10.0

    def force(self, name: str, given: np.ndarray) -> np.ndarray:
        assert given.any()
        return np.full(3, self.forces.get(name, 1.0))


def of(shares: Mapping[str, slice], **more: Any) -> Names:
    return names(Draws(shares, **more))  # type: ignore[arg-type]


def test_where_nothing_is_in_nothing_is_named() -> None:
    found = of({LAG: slice(0), WIND: slice(0)})
    assert (found.found, dict(found.tree.names), found.nothing) == ((), {}, 1.0)
    assert found.explanations == (Explanation((), 1.0),)


@pytest.mark.parametrize(("draws", "said"), [(49, False), (50, True), (100, True)])
def test_a_name_is_said_from_one_half_on_with_its_probability_in_the_draws(draws: int, said: bool) -> None:
    found = of({LAG: slice(draws), WIND: slice(0)})
    assert [x.name for x in found.found] == [LAG] * said
    assert found.tree.names == {LAG: pytest.approx(draws / DRAWS)}
    assert found.nothing == pytest.approx(1.0 - draws / DRAWS)
    assert all(x.tree.names == found.tree.names for x in found.found)


def test_what_is_in_hardly_any_draw_is_left_out() -> None:
    found = of({LAG: slice(100), WIND: slice(1)})
    assert found.tree.names == {LAG: 1.0}
    assert found.explanations == (Explanation((LAG,), 0.99), Explanation((LAG, WIND), 0.01))


def test_names_in_the_place_of_each_other_are_one_finding() -> None:
    (one,) = of({WIND: slice(0, 60), DRAG: slice(60, 95), LAG: slice(95, 98)}).found
    assert one.tree.names == {WIND: 0.6, DRAG: 0.35, LAG: 0.03}
    assert one.tree.credible(RULES.credible) == (WIND, DRAG)
    assert one.tree.families == {"air_tyres_road": 0.95, "brakes": 0.03}
    assert one.tree.stated(RULES.stated) == "air_tyres_road"


def test_names_that_act_together_are_findings_of_their_own_and_a_family_is_no_sum() -> None:
    both = of({LAG: slice(0, 95), FADE: slice(0, 90)})
    assert [x.name for x in both.found] == [LAG, FADE]
    assert both.tree.families == {"brakes": 0.95}


def test_the_cause_of_events_is_a_name_that_does_not_last() -> None:
    found = of({LAG: slice(80), FADE: slice(90)}, events={LAG: slice(45), FADE: slice(40)})
    assert {x.name: x.lasts for x in found.found} == {FADE: True, LAG: False}


@pytest.mark.parametrize(
    ("known", "share", "accepted"), [(True, 60, True), (False, 60, False), (False, 95, True)]
)
def test_beside_a_learned_simulator_only_what_is_sure_is_accepted(
    known: bool, share: int, accepted: bool
) -> None:
    (one,) = of({LAG: slice(share)}, known_physics=known).found
    assert one.accepted is accepted


def test_of_stated_names_the_one_that_adds_up_to_more_comes_first() -> None:
    shares = {LAG: slice(100), FADE: slice(95), WIND: slice(60)}
    said = [n.name for n in of(shares, forces={LAG: 0.02, FADE: -0.1, WIND: 1.0}).found]
    assert said == [FADE, LAG, WIND]


def test_no_more_names_than_a_verdict_may_have() -> None:
    found = of(dict.fromkeys((LAG, WIND, *OTHERS), slice(100)))
    assert len(found.found) == RULES.most_findings
    assert len(found.tree.names) == 6


def test_slow_drift_is_no_name() -> None:
    found = of({SLOW: slice(80), LAG: slice(0)})
    assert (found.found, dict(found.tree.names)) == ((), {})


AIR = Tree({"headwind": 0.6, "drag_area": 0.37, "brake_lag": 0.02, UNKNOWN: 0.01})


def test_a_node_is_the_sum_of_its_children() -> None:
    nodes = AIR.nodes()
    families = {n.node: n.probability for n in nodes if n.parent == ROOT}
    assert sum(families.values()) == pytest.approx(1.0)
    for family, p in families.items():
        children = [n.probability for n in nodes if n.parent == family]
        assert not children or sum(children) == pytest.approx(p)


def test_the_deepest_node_that_is_probable_enough_is_stated() -> None:
    assert AIR.stated(0.9) == "air_tyres_road"
    assert Tree({"brake_lag": 0.95, UNKNOWN: 0.05}).stated(0.9) == "brake_lag"
    assert Tree({"brake_lag": 0.5, "headwind": 0.5}).stated(0.9) == ROOT


def test_the_first_name_is_of_the_most_probable_family() -> None:
    tree = Tree({"brake_lag": 0.4, "headwind": 0.3, "drag_area": 0.3})
    assert tree.first == "headwind"
    assert next(iter(tree.families)) == FAMILY[tree.first]


def test_a_credible_set_is_the_smallest_that_holds_its_mass() -> None:
    assert AIR.credible(0.8) == ("headwind", "drag_area")
    assert AIR.credible(0.5) == ("headwind",)


def test_every_name_that_can_be_found_has_a_family() -> None:
    assert set(LIBRARY) <= set(FAMILY)
    assert set(PARAMETER_ERRORS) == set(REFIT_PARAMETERS) <= set(FAMILY)


def test_what_sensors_noise_adds_up_to_is_no_finding() -> None:
    (found,) = of({LAG: slice(0, 90)}, forces={LAG: 0.04}).found
    assert not found.accepted and of({LAG: slice(0, 90)}, forces={LAG: 0.06}).found[0].accepted
