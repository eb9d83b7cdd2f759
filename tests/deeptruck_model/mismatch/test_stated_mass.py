"""What is told of forces where nothing tells a mass, and a mass that is stated wrongly."""

from __future__ import annotations

import pytest

from deeptruck_model import mismatch, trucks
from deeptruck_model.errors import InputError

TRUCK = trucks.load("trucksim")


@pytest.mark.parametrize(
    ("mass_kg", "says"), [(-1.0, "cannot be"), (float("nan"), "cannot be"), (900.0, "own mass is")]
)
def test_a_mass_that_cannot_be_is_refused(mass_kg: float, says: str) -> None:
    with pytest.raises(InputError, match=says):
        mismatch.find_mismatch(TRUCK, [], mass_kg=mass_kg)
