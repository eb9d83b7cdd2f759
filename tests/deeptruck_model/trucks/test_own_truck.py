"""A truck from its data sheet: what is refused, and that the file drives."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from deeptruck_core.errors import InputError
from deeptruck_model import simulator_facts as facts
from deeptruck_model import simulators, trucks
from deeptruck_model.trucks import own_truck
from deeptruck_model.trucks.coast_down import UNITS, CoastDown

DATA = {
    "mass_kg": 24000,
    "gear_ratios": [14.8, 11.7, 9.0, 7.1, 5.6, 4.4, 3.4, 2.6, 2.0, 1.6, 1.27, 1.0],
    "axle_ratio": 2.85,
    "tyres": "315/80R22.5",
    "rated_torque_nm": 2300,
    "frontal_area_m2": 9.8,
    "full_braking_m_s2": 6.0,
}


def made(**changes: object) -> own_truck.Sheet:
    return own_truck.sheet({**DATA, **changes}, "sheet.yaml")


@pytest.mark.parametrize(
    ("tyres", "metres"), [("315/80R22.5", 0.522), ("295/75 r 22.5", 0.492), (0.5, 0.5), ("0.5", 0.5)]
)
def test_a_tyre_size_gives_the_rolling_radius(tyres: str | float, metres: float) -> None:
    assert own_truck.radius(tyres) == pytest.approx(metres, abs=0.001)


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"mass_kg": "heavy"}, "sheet.yaml: 'mass_kg' must be a number in kg"),
        ({"mass_kg": 24}, "'mass_kg' is 24 kg, not 1000 to 250000"),
        ({"mass_kg": True}, "must be a number"),
        ({"gear_ratios": [1.0, 2.0]}, "must fall from first to top gear"),
        ({"gear_ratios": "a, b"}, "must be numbers"),
        ({"tyres": "315-80"}, "give a size such as 315/80R22.5"),
        ({"tyres": 1.0}, "none of a truck"),
        ({"converter": "yes"}, "true or false"),
        ({"engine_unit": "Nm"}, "'engine_unit' must be N m or percent"),
        ({"mass": 3}, "did you mean mass_kg"),
        ({"axle_ratio": 7.0}, "at 80 km/h the engine turns 2845 rpm"),
        ({"gear_ratios": [1.9, 1.0], "rated_torque_nm": 1000}, "climbs 4 %"),
    ],
)
def test_a_wrong_value_is_one_line(changes: dict[str, object], says: str) -> None:
    with pytest.raises(InputError, match=says) as refused:
        own_truck.specification(made(**changes), "mine")
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("converter", [False, True])
def test_the_file_loads_and_has_the_numbers_of_the_sheet(tmp_path: Path, converter: bool) -> None:
    sheet = made(converter=converter)
    file = tmp_path / "mine.yaml"
    file.write_text(own_truck.text(sheet, own_truck.specification(sheet, "mine"), file.name))
    assert facts.simulator(f"truck:{file}").interface.mass_kg == 24000
    truck = simulators.load(f"truck:{file}")
    assert truck.interface.name == "mine" and truck.parameters()["mass"] == 24000

    def decelerates(brake: float) -> float:
        state, y = truck.reset(np.array([[0.0, 20.0, 0.0]])), np.zeros((1, 3))
        for _ in range(20):
            state, y = truck.step(state, np.array([[0.0, brake]]), np.zeros((1, 1)))
        return -float(y[0, 0])

    assert decelerates(100.0) == pytest.approx(6.0, abs=0.6)  # besides air, rolling and engine drag
    assert decelerates(0.0) < 0.5


# Coast-down coefficients are the truck's road load, in the units that people print


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
