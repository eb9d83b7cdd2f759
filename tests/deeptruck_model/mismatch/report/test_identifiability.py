"""What would separate names, and what would have been seen."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from deeptruck_model.constants import GRAVITY
from deeptruck_model.mismatch.mechanisms import LIBRARY
from deeptruck_model.mismatch.posterior.explain import explain
from deeptruck_model.mismatch.posterior.search import Search
from deeptruck_model.mismatch.report.findings import TOLD_BY, Finding
from deeptruck_model.mismatch.report.identifiability import smallest_visible, with_manoeuvres
from deeptruck_model.mismatch.residual.evidence import Evidence, Stretch
from deeptruck_model.mismatch.rules import Rules


def finding(group: list[str]) -> Finding:
    return Finding(
        {"effect": "headwind", "cannot_be_told_from": group, "would_be_told_by": "drive both ways"}
    )


def test_the_manoeuvre_of_the_nearest_rival_is_told_beside_its_own() -> None:
    alone, law, parameter, nameless = with_manoeuvres(
        [finding([]), finding(["drafting", "mass"]), finding(["mass"]), finding(["unknown"])]
    )
    assert alone.data["would_be_told_by"] == "drive both ways"
    assert law.data["would_be_told_by"].endswith(LIBRARY["drafting"].told_by)
    assert parameter.data["would_be_told_by"].endswith(TOLD_BY["mass"])
    assert nameless.data["would_be_told_by"] == "drive both ways"


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
    seen: list[dict[str, Any]] = [smallest_visible(e, explain(Search(e))) for e in (half, nothing_missing)]
    for p in nothing_missing.sensitivity:  # a little of it may be in any simulator, however long it is driven
        assert 0.0 < seen[1][p]["relative"] <= seen[0][p]["relative"] * 1.02
    always, rarely = (seen[1][f"steady force {how}"]["newton"] for how in ("all the time", "2 % of the time"))
    assert 0.0 < always < rarely


@pytest.mark.parametrize(("share", "seen"), [(1.3, True), (0.5, False)])
def test_what_is_as_large_as_was_promised_is_seen(
    nothing_missing: Evidence, share: float, seen: bool
) -> None:
    """240 N had been promised whatever the recordings, and a force of 300 N was not told."""
    e = nothing_missing
    size = smallest_visible(e, explain(Search(e)))["torque_gain"]["relative"]
    off = replace(e, residual=e.residual + share * size * e.sensitivity["torque_gain"])
    assert [c.effect for c in explain(Search(off)).causes] == (["torque_gain"] if seen else [])


def test_a_steady_force_must_be_more_than_a_zero_of_the_slope_sensor(nothing_missing: Evidence) -> None:
    quiet = replace(nothing_missing, residual=0.1 * nothing_missing.residual)
    seen = smallest_visible(quiet, explain(Search(quiet)))["steady force all the time"]["newton"]
    assert seen > Rules.slope_zero * GRAVITY * quiet.mass
