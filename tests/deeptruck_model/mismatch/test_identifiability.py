"""What would separate names, and what would have been seen."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from deeptruck_model.mismatch.evidence import Evidence, Stretch
from deeptruck_model.mismatch.explain import explain
from deeptruck_model.mismatch.findings import TOLD_BY, Finding
from deeptruck_model.mismatch.identifiability import smallest_visible, with_manoeuvres
from deeptruck_model.mismatch.mechanisms import LIBRARY
from deeptruck_model.mismatch.search import Search


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


def test_more_driving_shows_smaller_effects_and_rare_ones_must_be_larger(nothing_missing: Evidence) -> None:
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
    for p in nothing_missing.sensitivity:
        assert 0.0 < seen[1][p]["relative"] < seen[0][p]["relative"]
    always, rarely = (seen[1][f"steady force {how}"]["newton"] for how in ("all the time", "2 % of the time"))
    assert 0.0 < always < rarely
