"""A verdict says one probability for one name, and no size that may be zero."""

from __future__ import annotations

import pytest

from deeptruck_model.mismatch import Mismatch
from deeptruck_model.mismatch.folders import CORRECTION
from deeptruck_model.mismatch.mechanisms.families import UNKNOWN
from deeptruck_model.mismatch.report import lines
from deeptruck_model.mismatch.report.lines import NAMELESS
from deeptruck_model.mismatch.rules import Rules
from deeptruck_model.mismatch.verdict.result import Verdict
from deeptruck_model.mismatch.verdict.wording import spoken


@pytest.fixture(params=["lazy_brake", "right_truck", "dragging_brake", "heavier_truck"])
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


def test_what_a_correction_adds_is_stated(verdict: Verdict) -> None:
    """Each force is that of a finding, or of what has no name; each parameter has its interval, and its
    finding states the same change."""
    assert verdict.fit is not None
    found = {f.effect: f for f in verdict.findings}
    for name, strength in verdict.fit.corrected_forces.items():
        assert name == UNKNOWN or found[name].strength == strength
    assert verdict.fit.corrected_intervals.keys() == verdict.fit.corrected_parameters.keys()
    for name, change in verdict.fit.corrected_parameters.items():
        low, high = verdict.fit.corrected_intervals[name]
        assert low <= change <= high
        if name in found:
            assert found[name].parameters["relative_error"].value == pytest.approx(change, abs=1e-4)
    if verdict.offered == CORRECTION:
        said = " ".join(lines.contains(verdict))
        parts = {NAMELESS if n == UNKNOWN else spoken(n) for n in verdict.fit.corrected_forces}
        assert all(part in said for part in parts)


def test_no_finding_that_is_stated_has_an_interval_that_holds_zero(verdict: Verdict) -> None:
    for f in verdict.findings:
        if f.probability >= Rules().stated:
            sizes = [x for name, x in f.parameters.items() if not name.endswith("]")]
            assert all(x.ci95 is None or x.ci95[0] * x.ci95[1] > 0.0 for x in sizes)
