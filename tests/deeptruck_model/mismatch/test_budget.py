"""The budget: shares that add up, and the part that acts."""

from __future__ import annotations

import numpy as np
import pytest
from small_drives import N, evidence

from deeptruck_model.mismatch.budget import Budget, _shares, budget
from deeptruck_model.mismatch.posterior.regression import Regression
from deeptruck_model.mismatch.tree import EACH_DRIVE, LEFT_OVER, SLOW

NOWHERE = np.zeros(N, dtype=bool)
SIDES = np.repeat([0.08, -0.06, -0.02], N // 3)
SWELL = 0.06 * np.sin(2 * np.pi * np.arange(N) * 0.2 / 150.0)


def of(force: np.ndarray | float) -> Budget:
    return budget(Regression(evidence(force)), NOWHERE)


@pytest.mark.parametrize("force", [0.0, SIDES, SWELL])
def test_shares_add_up_to_one_and_lie_in_their_intervals(force: np.ndarray | float) -> None:
    found = of(force)
    assert sum(p.share for p in found.parts) == pytest.approx(1.0)
    assert all(p.low <= p.share <= p.high for p in found.parts)
    assert found.parts[-1].part == LEFT_OVER


def test_of_noise_most_is_left_over() -> None:
    assert of(0.0).share(LEFT_OVER) > 0.5


def test_what_differs_by_drive_is_each_drives_own() -> None:
    found = of(SIDES)
    assert found.parts[0].part == EACH_DRIVE
    assert found.share(EACH_DRIVE) > 0.6
    assert found.share(LEFT_OVER) < 0.2


def test_what_swells_slowly_is_slow() -> None:
    found = of(SWELL)
    assert found.parts[0].part == SLOW
    assert found.share(SLOW) > 0.5


def test_a_force_of_the_brakes_is_a_part_of_the_brakes() -> None:
    e = evidence()
    found = of(-0.4 * e["brake"])
    assert found.parts[0].part == "brakes"


def test_the_speed_error_is_what_a_free_run_adds_up() -> None:
    """A steady 0.05 m/s^2 makes 2 m/s in 40 s, and an rms of 2 / sqrt(3)."""
    assert of(np.full(N, 0.05)).speed_rmse == pytest.approx(2.0 / np.sqrt(3.0), rel=0.1)


def test_what_two_parts_cancel_counts_in_neither() -> None:
    """Two parts of one shape, 1.3 and -0.3 of what is seen: all of it is the first one's."""
    x = np.sin(np.arange(100.0))
    columns = np.column_stack([x, x, np.zeros(100), x])
    shares = _shares(np.array([1.3, -0.3]), [np.array([0]), np.array([1])], columns.T @ columns)
    assert shares == pytest.approx([1.0, 0.0, 0.0], abs=1e-9)
