"""Coast-down coefficients are the truck's road load, in the units that people print."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from deeptruck_core.errors import InputError
from deeptruck_model import trucks
from deeptruck_model.trucks.coast_down import UNITS, CoastDown

PRINTED = "mass: 24000\ncoast_down: {a: 240.0, b: 1.1, c: 0.19, unit: 'lbf, mph'}\n"


def truck(folder: Path, text: str) -> trucks.PhysicsTruck:
    path = folder / "own.yaml"
    path.write_text(text)
    return trucks.load("trucksim", str(path))


def test_a_truck_in_neutral_is_slowed_by_them(tmp_path: Path) -> None:
    """At v mph by 240 + 1.1 v + 0.19 v^2 pounds-force."""
    own = truck(tmp_path, PRINTED)
    assert CoastDown.of(own.parameters()).printed("lbf, mph") == pytest.approx((240.0, 1.1, 0.19))
    state = own.reset(np.array([[0.0, 50 * 0.44704, 0.0]]))
    state, response = own.step(state, np.zeros((1, 2)), np.zeros((1, 1)))
    inside, v = own.inside(state), response[0, 1] / 0.44704
    load = inside["drag_force"] + inside["rolling_force"]
    assert float(load[0]) == pytest.approx((240.0 + 1.1 * v + 0.19 * v**2) * 4.4482216152605, rel=3e-3)


@pytest.mark.parametrize("unit", UNITS)
def test_printed_and_read_they_are_the_same(unit: str) -> None:
    a, b, c = CoastDown(900.0, 12.0, 3.6).printed(unit)
    again = CoastDown.read({"a": a, "b": b, "c": c, "unit": unit}, "own.yaml")
    assert (again.a, again.b, again.c) == pytest.approx((900.0, 12.0, 3.6))


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("coast_down: 5", "needs a, b, c and unit, such as"),
        ("coast_down: {a: 1, b: 2, c: 3, unit: kN}", "has the unit 'kN'; choose from 'N, m/s'"),
        ("coast_down: {a: x, b: 2, c: 3, unit: 'N, m/s'}", "must be numbers"),
        ("coast_down: {a: 900, b: -2, c: 3, unit: 'N, m/s'}", "not below zero"),
        ("drag_area: 5\ncoast_down: {a: 900, b: 2, c: 3, unit: 'N, m/s'}", "says what 'drag_area' says"),
        ("coast_down: {a: 900, b: 2, c: 300, unit: 'N, m/s'}", "drag_area"),
    ],
)
def test_what_cannot_be_is_one_line(tmp_path: Path, text: str, says: str) -> None:
    with pytest.raises(InputError, match=says) as refused:
        truck(tmp_path, text)
    assert "\n" not in str(refused.value)
