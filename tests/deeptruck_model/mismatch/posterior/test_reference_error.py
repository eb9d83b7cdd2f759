"""What a learned truck learned imperfectly is known from the recordings that it keeps, and is no finding."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from small_drives import alike

from deeptruck_model.mismatch.posterior.names import Names, names
from deeptruck_model.mismatch.posterior.posterior import posterior
from deeptruck_model.mismatch.posterior.reference_error import (
    _slow_noise,
    reference_drives,
    with_reference_error,
)
from deeptruck_model.mismatch.posterior.regression import Regression
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.rules import Limits, Rules

BARE: Any = SimpleNamespace(reference=())


def with_own(e: Evidence, own: Evidence) -> Evidence:
    """Beside a learned simulator whose own recordings have this residual."""
    return replace(e, known_physics=False, reference=replace(own, known_physics=False))


def test_a_simulator_that_keeps_no_recordings_has_no_reference() -> None:
    assert reference_drives(BARE, measured_acceleration=False) == []


def test_an_error_on_its_own_recordings_too_is_not_detected(nothing_missing: Evidence) -> None:
    warm = 1.0 - np.exp(-nothing_missing["elapsed"] / 200.0)
    fades = 0.4 * nothing_missing["brake"] * warm
    flawed = replace(nothing_missing, residual=nothing_missing.residual + fades)
    first, second = (Regression(with_own(flawed, own)) for own in (flawed, nothing_missing))
    same, new = _names(first), _names(alike(second, first))
    assert not any(n.accepted for n in same.found)
    assert next(n for n in new.found if n.accepted).tree.families["brakes"] > 0.8


def _names(search: Regression) -> Names:
    return names(posterior(search, sweeps=40))


def test_a_rare_jolt_is_no_slow_noise(nothing_missing: Evidence) -> None:
    jolted = nothing_missing.residual.copy()
    jolted[1000:1040] += 3.0
    assert _slow_noise(replace(nothing_missing, residual=jolted)) < 1.3 * _slow_noise(nothing_missing)


def test_slow_noise_is_as_strong_as_the_trucks_own_drifts(nothing_missing: Evidence) -> None:
    drift = 0.05 * np.sin(2 * np.pi * np.arange(len(nothing_missing)) * nothing_missing.dt / 90.0)
    drifting = replace(nothing_missing, residual=nothing_missing.residual + drift)
    assert _slow_noise(nothing_missing) == Rules().slow_noise < 0.04 < _slow_noise(drifting) < 0.12


@pytest.mark.parametrize(("off", "expected"), [(0.0, 0.02), (0.5, Limits.usual_discrepancy)])
def test_without_own_recordings_the_discrepancy_is_what_learned_simulators_usually_have(
    nothing_missing: Evidence, off: float, expected: float
) -> None:
    e = replace(nothing_missing, known_physics=False, residual=nothing_missing.residual + off)
    found = with_reference_error(BARE, e, measured_acceleration=False, seed=0)
    assert 0.0 < found.model_discrepancy <= expected


def test_known_physics_has_no_discrepancy(nothing_missing: Evidence) -> None:
    assert with_reference_error(BARE, nothing_missing, measured_acceleration=False, seed=0) is nothing_missing
