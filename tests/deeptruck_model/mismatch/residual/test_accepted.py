"""No truck is asked for that cannot be, whatever a fit asks for."""

from __future__ import annotations

import pytest

from deeptruck_model import trucks
from deeptruck_model.mismatch.residual.gather import accepted

TRUCK = trucks.load("trucksim")
MASS = TRUCK.parameters()["mass"]


def test_what_a_truck_may_have_stays_as_it_is() -> None:
    asked = {"mass": 0.3, "drag_area": -0.2, "brake_gain": 0.25, "unheard_of": 7.0}
    assert accepted(TRUCK, asked, near=0.02) == asked


@pytest.mark.parametrize("near", [0.0, 0.02])
def test_a_truck_of_more_than_a_hundred_tonnes_is_taken_nearer(near: float) -> None:
    """A run ended with 'mass is 112866 kg, not 1000 to 100000'."""
    change = accepted(TRUCK, {"mass": 112866.0 / MASS - 1.0}, near)["mass"]
    assert 0.5 < change < 99999.0 / MASS - 1.0
    TRUCK.with_parameters({"mass": MASS * (1.0 + change) * (1.0 + near)})
