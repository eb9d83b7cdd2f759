"""What a learned truck learned badly is known from the recordings it keeps, and is no missing physics."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from deeptruck_model.mismatch.posterior import nuisances
from deeptruck_model.mismatch.posterior.explain import explain
from deeptruck_model.mismatch.posterior.search import Search
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.rules import Rules


def flawed(e: Evidence) -> Evidence:
    """The simulator brakes 30 % too little: that is how it was learned, and on every drive the same."""
    return replace(e, residual=e.residual - 0.3 * e["brake"])


def test_a_truck_that_keeps_nothing_has_no_known_error() -> None:
    bare: Any = SimpleNamespace(reference=())
    assert nuisances.known(bare, measured_acceleration=False, seed=0, rules=Rules()) is None


def test_a_flaw_that_was_always_there_is_no_finding(nothing_missing: Evidence) -> None:
    own = flawed(nothing_missing)
    left = nuisances.allow_for(flawed(nothing_missing), own)
    assert left.tolerance["parameter:brake_gain"] > 0.0 and left.model_discrepancy > 0.03
    assert explain(Search(left)).causes == ()
    new = nuisances.allow_for(flawed(nothing_missing), nothing_missing)
    assert [c.effect for c in explain(Search(new)).causes] == ["brake_gain"]


def test_what_a_perfect_truck_keeps_costs_little(nothing_missing: Evidence) -> None:
    left = nuisances.allow_for(nothing_missing, nothing_missing)
    assert left.residual == pytest.approx(nothing_missing.residual)
    assert max(left.tolerance.values()) < 20.0 and left.model_discrepancy < 0.03


@pytest.mark.long
def test_more_new_driving_makes_the_same_flaw_dearer(nothing_missing: Evidence) -> None:
    own = flawed(nothing_missing)
    once, twice = nuisances._penalties(own, 1.0), nuisances._penalties(own, 2.0)
    assert once["parameter:brake_gain"] > 0.0
    assert {n: 2.0 * x for n, x in once.items()} == pytest.approx(twice)


def test_a_rare_jolt_is_no_error_of_the_whole(nothing_missing: Evidence) -> None:
    jolted = nothing_missing.residual.copy()
    jolted[1000:1040] += 3.0
    calm = nuisances._slow_rms(nothing_missing)
    assert nuisances._slow_rms(replace(nothing_missing, residual=jolted)) < 1.3 * calm


@pytest.mark.long
def test_slow_noise_is_as_strong_as_the_trucks_own_drifts(nothing_missing: Evidence) -> None:
    drift = 0.05 * np.sin(2 * np.pi * np.arange(len(nothing_missing)) * nothing_missing.dt / 90.0)
    drifting = replace(nothing_missing, residual=nothing_missing.residual + drift)
    quiet, restless = (nuisances.allow_for(nothing_missing, own) for own in (nothing_missing, drifting))
    assert quiet.slow_noise == Rules.slow_noise < 0.04 < restless.slow_noise < 0.12
    assert restless.series(0.03).slow < quiet.series(0.03).slow


def test_an_unmeasured_error_is_no_larger_than_it_is_off_most_of_the_time(nothing_missing: Evidence) -> None:
    quiet = nuisances.allow_for_the_unmeasured(nothing_missing)
    now_and_then = np.where(nothing_missing["brake"] > 0.0, 0.5, 0.0)
    seldom = replace(nothing_missing, residual=nothing_missing.residual + now_and_then)
    always = replace(nothing_missing, residual=nothing_missing.residual + 0.5)
    assert 0.0 < quiet.model_discrepancy < 0.02
    assert nuisances.allow_for_the_unmeasured(seldom).model_discrepancy < 0.02
    assert nuisances.allow_for_the_unmeasured(always).model_discrepancy == nuisances.LEARNABLE
    assert quiet.slow_noise == Rules.slow_noise
