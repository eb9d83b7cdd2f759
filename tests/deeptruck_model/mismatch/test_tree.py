"""Probabilities over the tree of names."""

from __future__ import annotations

import pytest

from deeptruck_model.mismatch.mechanisms import LIBRARY
from deeptruck_model.mismatch.posterior.effect_classifier import effect_classifier
from deeptruck_model.mismatch.tree import FAMILY, ROOT, UNKNOWN, Tree

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


def test_names_behind_a_missing_input_are_unknown() -> None:
    tree = AIR.without(frozenset({"brake_lag"}))
    assert "brake_lag" not in tree.names
    assert tree.names[UNKNOWN] == pytest.approx(0.03)


@pytest.mark.parametrize("right", [0.41, 0.05])
def test_what_holds_only_if_another_name_is_right_is_as_probable_as_both(right: float) -> None:
    alone = Tree({"brake_lag": 0.97, "brake_fade": 0.01, UNKNOWN: 0.02})
    tree = alone.given(right)
    assert tree.names["brake_lag"] == pytest.approx(right * 0.97)
    assert tree.names[UNKNOWN] == pytest.approx(right * 0.02)  # that the other is wrong is no evidence for it
    assert tree.stated(0.9) == ROOT
    assert tree.credible(0.8) == alone.credible(0.8)


def test_every_name_that_can_be_found_has_a_family() -> None:
    assert set(LIBRARY) <= set(FAMILY)
    assert set(effect_classifier().names) - {"nothing"} <= set(FAMILY)
