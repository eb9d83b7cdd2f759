"""A verdict says one probability for one name, and no size that may be zero."""

from __future__ import annotations

import pytest

from deeptruck_model.mismatch import Mismatch
from deeptruck_model.mismatch.result import Verdict
from deeptruck_model.mismatch.rules import Rules
from deeptruck_model.mismatch.tree import UNKNOWN


@pytest.fixture(params=["lazy_brake", "right_truck"])
def verdict(request: pytest.FixtureRequest) -> Verdict:
    """The verdicts of the whole runs that the tests share."""
    found: Mismatch = request.getfixturevalue(request.param)
    return found.result


def test_a_name_has_one_probability(verdict: Verdict) -> None:
    """In finding, tree and explanations; a family too."""
    tree = {n.node: n.probability for n in verdict.tree}
    assert tree and max(tree.values()) <= 1.0
    sets = sum(x.probability for x in verdict.explanations)
    for f in verdict.findings:
        if f.effect == UNKNOWN or f.evidence_nats is None:
            continue  # a part of the budget, or a fault between sensors
        assert f.probability == pytest.approx(tree[f.effect], abs=1e-3)
        assert f.family_probability == pytest.approx(tree[f.family], abs=1e-3)
        assert set(f.credible_set) <= tree.keys()
        listed = sum(x.probability for x in verdict.explanations if f.effect in x.names)
        assert listed - 1e-3 <= f.probability <= listed + 1.0 - sets + 1e-3
    none = next((x.probability for x in verdict.explanations if not x.names), 0.0)
    assert tree["nothing"] == pytest.approx(none, abs=1.0 - sets + 1e-3)


def test_no_finding_that_is_stated_has_an_interval_that_holds_zero(verdict: Verdict) -> None:
    for f in verdict.findings:
        if f.probability >= Rules().stated:
            sizes = [x for name, x in f.parameters.items() if not name.endswith("]")]
            assert all(x.ci95 is None or x.ci95[0] * x.ci95[1] > 0.0 for x in sizes)
