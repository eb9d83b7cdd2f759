"""What is said of a parameter, and what is not."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from deeptruck_model.mismatch.posterior import rivals
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.rules import Rules


def looked_at(e: Evidence, gain: float, change: float, sd: float, zero: tuple[float, float]) -> bool:
    """Whether a torque gain worth `gain` nats is told, where a slope sensor's `zero` has a score and a size,
    rise over run."""
    large = {name: 5.0 * column for name, column in e.sensitivity.items()}
    instead = SimpleNamespace(score=zero[0], coefficients=lambda name: np.array([zero[1]]))
    search: Any = SimpleNamespace(
        rules=Rules(),
        e=replace(e, sensitivity=large),
        candidate_terms=lambda mechanism: ["zero"],
        model=lambda *_: instead,
    )
    before: Any = SimpleNamespace(free=frozenset(), score=0.0, named=(), fit=None)
    after: Any = SimpleNamespace(free=frozenset({"torque_gain"}), score=gain)
    model: Any = SimpleNamespace(moved=lambda name: change, moved_sd=lambda name: sd, named=())
    return rivals._parameter(search, model, before, after, []) is not None


@pytest.mark.parametrize(
    ("change", "sd", "told"),
    [(0.034, 0.0117, False), (0.034, 0.005, True), (-0.034, 0.005, True), (0.08, 0.02, True)],
)
def test_a_parameter_that_may_be_as_nearly_right_as_any_is_not_told(
    nothing_missing: Evidence, change: float, sd: float, told: bool
) -> None:
    """A mass given 1.2 % too small came out as 3.4 +- 2.3 % and was told."""
    assert looked_at(nothing_missing, 32.0, change, sd, (-99.0, 0.001)) == told


@pytest.mark.parametrize(
    ("gain", "zero", "told"),
    [
        (52.0, (49.0, 0.0011), False),
        (52.0, (49.0, -0.0011), False),
        (52.0, (49.0, 0.003), True),
        (52.0, (20.0, 0.0011), True),
        (300.0, (297.0, 0.0011), True),
    ],
)
def test_a_parameter_is_not_told_where_an_ordinary_zero_of_the_slope_sensor_does_as_well(
    nothing_missing: Evidence, gain: float, zero: tuple[float, float], told: bool
) -> None:
    """Rolling resistances 16 to 28 % off had been told of trucks that had them right."""
    assert looked_at(nothing_missing, gain, 0.2, 0.02, zero) == told
