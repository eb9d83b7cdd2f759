"""What would separate names, and what would have been seen."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from deeptruck_model.constants import GRAVITY
from deeptruck_model.mismatch.finding import Finding, Kind
from deeptruck_model.mismatch.mechanisms import LIBRARY
from deeptruck_model.mismatch.posterior.explain import explain
from deeptruck_model.mismatch.posterior.search import Search
from deeptruck_model.mismatch.report.findings import TOLD_BY
from deeptruck_model.mismatch.report.identifiability import smallest_visible, with_manoeuvres
from deeptruck_model.mismatch.residual.evidence import Evidence, Stretch
from deeptruck_model.mismatch.rules import Rules
from deeptruck_model.mismatch.sentence import Sentence


def finding(*group: str) -> Finding:
    says, by = Sentence.of("air moves"), Sentence.of("drive both ways")
    alone = Finding(Kind.PHYSICS, "headwind", says, "F = 0", {}, 0.9, by, ())
    return replace(alone, cannot_be_told_from=group)


def _opened(text: str) -> str:
    return text[:1].upper() + text[1:]


def test_the_manoeuvre_of_the_nearest_rival_is_told_beside_its_own() -> None:
    alone, law, parameter, nameless = with_manoeuvres(
        [finding(), finding("drafting", "mass"), finding("mass"), finding("unknown")]
    )
    assert str(alone.would_be_told_by) == "drive both ways"
    assert str(law.would_be_told_by).endswith(_opened(LIBRARY["drafting"].told_by))
    assert str(parameter.would_be_told_by).endswith(_opened(TOLD_BY["mass"]))
    assert str(nameless.would_be_told_by) == "drive both ways"


@pytest.mark.long
def test_more_driving_asks_for_no_larger_effects_and_rare_ones_must_be_larger(
    nothing_missing: Evidence,
) -> None:
    part = nothing_missing.stretches[0].rows
    half = replace(
        nothing_missing,
        stretches=(Stretch("a", 0, part.stop, 0.0, False),),
        **{n: getattr(nothing_missing, n)[part] for n in ("residual", "simulated", "disagreement", "valid")},
        signals={n: x[part] for n, x in nothing_missing.signals.items()},
        sensitivity={n: x[part] for n, x in nothing_missing.sensitivity.items()},
        rerun=lambda name, amount: np.zeros(part.stop),
    )
    seen = [smallest_visible(e, explain(Search(e))) for e in (half, nothing_missing)]
    for p in nothing_missing.sensitivity:  # a little of it may be in any simulator, however long it is driven
        assert 0.0 < seen[1].parameters[p] <= seen[0].parameters[p] * 1.06  # a step of the search
    assert 0.0 < seen[1].always < seen[1].rarely


@pytest.mark.parametrize(("share", "seen"), [(1.3, True), pytest.param(0.5, False, marks=pytest.mark.long)])
def test_what_is_as_large_as_was_promised_is_seen(
    nothing_missing: Evidence, share: float, seen: bool
) -> None:
    """240 N had been promised whatever the recordings, and a force of 300 N was not told."""
    e = nothing_missing
    size = smallest_visible(e, explain(Search(e))).parameters["torque_gain"]
    off = replace(e, residual=e.residual + share * size * e.sensitivity["torque_gain"])
    assert [c.effect for c in explain(Search(off)).causes] == (["torque_gain"] if seen else [])


def test_a_steady_force_must_be_more_than_a_zero_of_the_slope_sensor(nothing_missing: Evidence) -> None:
    e = nothing_missing
    seen = smallest_visible(e, explain(Search(e))).always * e.mass
    assert seen > Rules.slope_zero * GRAVITY * e.mass
