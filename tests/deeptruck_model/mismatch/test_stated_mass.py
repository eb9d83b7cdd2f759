"""A stated mass that cannot be, and one that the drives contradict."""

from __future__ import annotations

from dataclasses import replace

import pytest
from small_drives import drives

from deeptruck_model import mismatch, trucks
from deeptruck_model.errors import InputError

TRUCK = trucks.load("trucksim")


@pytest.mark.parametrize(
    ("mass_kg", "says"),
    [(-1.0, "no vehicle's"), (float("nan"), "must be a number in kg"), (900.0, "own mass is")],
)
def test_a_mass_that_cannot_be_is_refused(mass_kg: float, says: str) -> None:
    with pytest.raises(InputError, match=says):
        mismatch.find_mismatch(TRUCK, [], mass_kg=mass_kg)


@pytest.mark.parametrize(("stated_kg", "said"), [(26000.0, True), (20000.0, False)])
def test_a_recorded_mass_that_the_drives_contradict_is_a_caveat(stated_kg: float, said: bool) -> None:
    stated = [replace(r, interface=replace(r.interface, mass_kg=stated_kg)) for r in drives(TRUCK, 3)]
    found = mismatch.find_mismatch(TRUCK, stated[:2], stated[2:]).result
    lines = [line for line in found.caveats if "states a mass of 26.0 t, and the drives show 20" in line]
    assert len(lines) == said
