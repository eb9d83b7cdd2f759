"""What a force must be to be noticed in a free run."""

from __future__ import annotations

import numpy as np
import pytest

from deeptruck_model.mismatch.correction.worth import NOTICED_M_S2, noticed
from deeptruck_model.mismatch.residual.evidence import Evidence


@pytest.mark.parametrize(("size", "told"), [(0.5, False), (2.0, True)])
def test_a_steady_force_is_noticed_by_its_size(nothing_missing: Evidence, size: float, told: bool) -> None:
    force = np.full(len(nothing_missing), -size * NOTICED_M_S2)
    assert noticed(force, nothing_missing, 40.0) == told


def test_a_force_to_and_fro_that_is_gone_by_the_end_of_a_run_is_not_noticed(
    nothing_missing: Evidence,
) -> None:
    e = nothing_missing
    force = 0.1 * np.sin(2.0 * np.pi * e["elapsed"])
    assert not noticed(force, e, 40.0)


@pytest.mark.parametrize("at_the_end", [False, True])
def test_one_run_in_which_it_acts_is_enough(nothing_missing: Evidence, at_the_end: bool) -> None:
    e, force = nothing_missing, np.zeros(len(nothing_missing))
    (first, *_), rows = e.stretches, round(3.0 / nothing_missing.dt)
    begin = first.stop - rows if at_the_end else first.start
    force[begin : begin + rows] = 0.1
    assert noticed(force, e, 40.0)
