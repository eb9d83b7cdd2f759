"""A simulator that answers what no vehicle does gets no verdict."""

from __future__ import annotations

import numpy as np
import pytest

from deeptruck_core.errors import InputError
from deeptruck_model import trucks
from deeptruck_model.mismatch import find_mismatch
from deeptruck_model.trucks import driving_cycles

TRUCK = trucks.load("trucksim")


class Broken:
    """What a wrong unit inside a model makes of it: it stops from any speed within a second."""

    def reset(self, batch: int) -> None: ...

    def force(self, view: trucks.View, dt: float) -> np.ndarray:
        return np.asarray(-30.0 * view.mass * (view.speed > 3.0))


def test_a_simulator_that_answers_what_no_vehicle_does_is_refused() -> None:
    broken = TRUCK.with_forces([Broken()])
    with pytest.raises(InputError, match=r"more than 12 m/s\^2 in \d+ % of samples"):
        find_mismatch(broken, [driving_cycles.drive(TRUCK, seconds=120.0, seed=k) for k in range(2)])
