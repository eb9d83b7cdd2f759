"""A constant of a drive's own, from its first minutes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from small_drives import TRUCK, drives

from deeptruck_model import simulators
from deeptruck_model.errors import InputError
from deeptruck_model.mismatch.adaptation import PRIOR, adapt, begin, with_constant
from deeptruck_model.mismatch.correction.improvement import free_windows

FORCE = -0.06


class SteadyWind:
    """A force of -0.06 m/s^2 against the truck while it moves."""

    def reset(self, batch: int) -> None: ...

    def force(self, view, dt: float) -> np.ndarray:
        return FORCE * view.mass * (view.speed > 0.3)


def test_the_constant_of_a_drive_is_found_and_helps_the_rest_of_it(tmp_path: Path) -> None:
    (drive,) = drives(TRUCK.with_forces([SteadyWind()], []), 1, 420.0)
    found = adapt(TRUCK, [drive], 210.0)
    assert found.constant == pytest.approx(FORCE, abs=0.02)
    assert found.sd < 0.5 * PRIOR
    rest = begin(TRUCK, [drive.piece(2100, len(drive))], 1e9)
    before, after = (free_windows(s, rest, 40.0).rmse().speed for s in (TRUCK, found.truck))
    assert after < 0.5 * before
    found.truck.save(tmp_path / "adapted")
    again = free_windows(simulators.load(str(tmp_path / "adapted")), rest, 40.0).rmse().speed
    assert again == pytest.approx(after, rel=1e-6)


def test_a_drive_without_anything_of_its_own_is_left_as_it_is() -> None:
    found = adapt(TRUCK, drives(TRUCK, 1, 240.0), 240.0)
    assert abs(found.constant) < 0.01


def test_a_constant_accelerates_by_itself() -> None:
    (p,) = begin(TRUCK, drives(TRUCK, 1, 120.0), 120.0)
    free = free_windows(with_constant(TRUCK, 0.05), [p], 20.0), free_windows(TRUCK, [p], 20.0)
    gained = (free[0].speed - free[1].speed)[:, -1]
    assert 0.7 < float(np.median(gained)) <= 1.0  # turning masses take a part; a run may shift otherwise


def test_a_drive_that_is_too_short_is_refused() -> None:
    with pytest.raises(InputError, match="no unbroken"):
        adapt(TRUCK, [drives(TRUCK, 1, 60.0)[0].piece(0, 100)])
