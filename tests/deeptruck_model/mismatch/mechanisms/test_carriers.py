"""Sizes that were fitted about other parameters than those of the truck they go into."""

from __future__ import annotations

import numpy as np
import pytest

from deeptruck_core.signals import ACCELERATION
from deeptruck_model import simulators, trucks
from deeptruck_model.mismatch.correction.corrected_truck import CorrectedTruck, Term
from deeptruck_model.mismatch.mechanisms import variant
from deeptruck_model.mismatch.mechanisms.carriers import factors

BASE = trucks.load("trucksim")
WIND = Term("headwind", (variant("one wind", wind_m_s=4.0),), (1.2,))
MORE = {"drag_area": 0.33, "mass": 0.2}


def added(moved: dict[str, float], by: dict[str, float] | None) -> np.ndarray:
    """What the wind adds to the acceleration at 20 m/s, (n,)."""
    y0 = np.zeros((1, len(BASE.interface.y)))
    y0[0, list(BASE.interface.y).index("speed")] = 20.0
    u, w = np.zeros((1, 4, len(BASE.interface.u))), np.zeros((1, 4, len(BASE.interface.w)))
    windy, calm = (
        simulators.free_run(CorrectedTruck(BASE, terms, moved, None, False, (), by), u, w, y0).y[0, 1:]
        for terms in ([WIND], [])
    )
    return np.asarray(windy[:, ACCELERATION] - calm[:, ACCELERATION])


def test_where_nothing_moved_forces_are_as_they_were() -> None:
    assert set(factors({}, {}).values()) == {1.0}
    assert set(factors(MORE, MORE).values()) == {1.0}


def test_a_force_keeps_its_size_in_a_truck_with_less_drag() -> None:
    there, here = added(MORE, None), added({}, factors(MORE, {}))
    assert here == pytest.approx(there, rel=0.01)
    assert abs(added({}, None)[0] / there[0] - 1.0) > 0.05  # without, it does not


def test_a_correction_is_the_same_once_it_was_written(tmp_path) -> None:
    by = factors(MORE, {})
    CorrectedTruck(BASE, [WIND], {}, None, True, (), by).save(tmp_path / "sim")
    read = simulators.load(tmp_path / "sim")
    assert isinstance(read, CorrectedTruck) and read._carried == pytest.approx(by)
