"""Probabilities over the tree of names."""

from __future__ import annotations

import pytest

from deeptruck_model.mismatch.mechanisms import LIBRARY
from deeptruck_model.mismatch.mechanisms.families import FAMILY, ROOT, UNKNOWN
from deeptruck_model.mismatch.mechanisms.others import PARAMETER_ERRORS
from deeptruck_model.mismatch.posterior.names import Tree
from deeptruck_model.mismatch.residual.gather import REFIT_PARAMETERS

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
