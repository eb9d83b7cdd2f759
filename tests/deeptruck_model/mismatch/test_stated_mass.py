"""What is told of forces where nothing tells a mass, and a mass that is stated wrongly."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import pytest

from deeptruck_model import mismatch, trucks
from deeptruck_model.errors import InputError
from deeptruck_model.mismatch import find
from deeptruck_model.mismatch.residual.evidence import Evidence

TRUCK = trucks.load("trucksim")


def test_forces_without_a_mass_are_told_per_kilogram() -> None:
    """A small car's slopes came to 7000 N, of the 20 t that are taken where nothing tells a mass."""
    known, unknown = (cast(Evidence, SimpleNamespace(mass_known=told)) for told in (True, False))
    found: Any = [SimpleNamespace(cause=SimpleNamespace())]
    (said,) = find._without_mass(unknown, found)
    assert "m/s^2" in said and "--mass-kg" in said
    assert find._without_mass(known, found) == find._without_mass(unknown, []) == []


@pytest.mark.parametrize(
    ("mass_kg", "says"), [(-1.0, "cannot be"), (float("nan"), "cannot be"), (900.0, "own mass is")]
)
def test_a_mass_that_cannot_be_is_refused(mass_kg: float, says: str) -> None:
    with pytest.raises(InputError, match=says):
        mismatch.find_mismatch(TRUCK, [], mass_kg=mass_kg)
