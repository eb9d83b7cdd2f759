"""What is said of a parameter, and what is not."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from deeptruck_model.mismatch import rivals
from deeptruck_model.mismatch.evidence import Evidence


@pytest.mark.parametrize(
    ("change", "sd", "told"),
    [(0.034, 0.0117, False), (0.034, 0.005, True), (-0.034, 0.005, True), (0.08, 0.02, True)],
)
def test_a_parameter_that_may_be_as_nearly_right_as_any_is_not_told(
    nothing_missing: Evidence, change: float, sd: float, told: bool
) -> None:
    """A mass given 1.2 % too small came out as 3.4 +- 2.3 % and was told."""
    large = {name: 5.0 * column for name, column in nothing_missing.sensitivity.items()}
    search: Any = SimpleNamespace(e=replace(nothing_missing, sensitivity=large))
    before: Any = SimpleNamespace(free=frozenset(), score=0.0)
    after: Any = SimpleNamespace(free=frozenset({"torque_gain"}), score=32.0)
    model: Any = SimpleNamespace(change=lambda name: change, change_sd=lambda name: sd, named=())
    cause = rivals._parameter(search, model, before, after, [])
    assert (cause is not None) == told
