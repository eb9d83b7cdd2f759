"""Shift speeds and pedal of a truck that is known are learned from its drives."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from deeptruck_core.errors import InputError
from deeptruck_model import simulators, trucks
from deeptruck_model.recordings import Recording
from deeptruck_model.trucks import PhysicsTruck
from deeptruck_model.trucks.driven_controls import learned
from deeptruck_model.trucks.specification import from_file, specification_from_dict

SHEET = trucks.load("volvo").specification  # its command is a percentage
PEDAL = ((0.0, 20.0, 50.0, 100.0), (0.0, 0.08, 0.35, 1.0))
SHIFTS = {"upshift_low": 110.0, "upshift_high": 150.0, "downshift_low": 85.0, "downshift_high": 105.0}


def drives(truck: PhysicsTruck, seconds: float = 500.0, brakes: float = 1.0) -> list[Recording]:
    """Two drives in which the pedal is held for 4 to 15 s, and sometimes braked, above 24 m/s always."""
    return [drive(truck, round(seconds / truck.dt), seed, brakes) for seed in (1, 2)]


def drive(truck: PhysicsTruck, n: int, seed: int, brakes: float) -> Recording:
    most = 100.0 if truck.interface.engine_unit == "percent" else 1700.0
    rng = np.random.default_rng(seed)
    state, y = truck.reset(np.array([[0.0, 10.0, 5.0]])), np.array([[0.0, 10.0, 5.0]])
    seen: dict[str, list[float]] = {}
    pedal, brake, until = 0.0, 0.0, 0
    for k in range(n):
        if k >= until or (y[0, 1] > 24.0 and brake == 0.0):
            braked = y[0, 1] > 24.0 or (y[0, 1] > 8.0 and rng.random() < 0.15)
            pedal, brake = (0.0, brakes) if braked else (float(rng.uniform(0.0, most)), 0.0)
            until = k + int(rng.uniform(4.0, 15.0) / truck.dt)
        now = {"engine_command": pedal, "brake_command": brake, "grade": 0.0, "acceleration": y[0, 0]}
        inside = truck.inside(state)
        now |= {"speed": y[0, 1], "fuel_rate": y[0, 2], **{c: inside[c][0] for c in ("gear", "engine_speed")}}
        for name, value in now.items():
            seen.setdefault(name, []).append(float(value))
        state, y = truck.step(state, np.array([[pedal, brake]]), np.zeros((1, 1)))
    channels = {name: np.array(values) for name, values in seen.items()}
    return Recording(f"drive{seed}", truck.dt, channels, truck.interface)


@pytest.fixture(scope="module")
def driven() -> list[Recording]:
    return drives(PhysicsTruck(replace(SHEET, pedal=PEDAL).with_values(SHIFTS)))


def test_the_pedal_and_the_shift_speeds_are_those_that_were_driven(driven: list[Recording]) -> None:
    found = learned(SHEET, driven)
    assert found.truck.pedal is not None
    at = np.array([20.0, 50.0, 80.0])
    assert np.interp(at, *found.truck.pedal) == pytest.approx(np.interp(at, *PEDAL), abs=0.06)
    for name in ("upshift_low", "downshift_low"):
        assert abs(found.truck.values[name] - SHIFTS[name]) < abs(SHEET.values[name] - SHIFTS[name])


def test_brakes_and_engine_friction_of_the_driven_truck_are_learned() -> None:
    sheet = trucks.load("trucksim").specification
    driven = sheet.with_values({"brake_pushout": 0.0, "engine_friction": 1.8})
    found = learned(sheet, drives(PhysicsTruck(driven), brakes=20.0)).truck.values
    assert found["brake_pushout"] < 0.005
    assert found["engine_friction"] == pytest.approx(1.8, rel=0.05)
    kept = ("shift_time", "boost_lag", "mass", "drag_area", "torque_gain")
    assert {n: found[n] for n in kept} == {n: sheet.values[n] for n in kept}


def test_lags_and_shifts_are_learned_about_their_events() -> None:
    sheet = trucks.load("trucksim").specification
    true = {"brake_lag": 0.0, "brake_lag_rear": 0.0, "brake_release_lag": 0.0, "shift_time": 0.4}
    found = learned(sheet, drives(PhysicsTruck(sheet.with_values(true)), brakes=20.0)).truck.values
    assert {n: found[n] for n in true if n != "shift_time"} == {n: 0.0 for n in true if n != "shift_time"}
    assert found["shift_time"] == pytest.approx(0.4, abs=0.15)
    kept = ("engine_inertia", "engine_friction", "boost_lag", "brake_pushout")
    assert {n: found[n] for n in kept} == {n: sheet.values[n] for n in kept}


def test_a_truck_with_one_gear_needs_no_gear_channel() -> None:
    sheet = replace(trucks.load("trucksim").specification, ratios=(1.0,))
    driven = drives(PhysicsTruck(sheet.with_values({"engine_friction": 0.0})))
    for r in driven:
        r.channels.pop("gear")
    found = learned(sheet, driven)
    assert found.truck.values["engine_friction"] < 0.1


def test_a_deceleration_by_the_brakes_alone_is_learned() -> None:
    driven = SHEET.with_values({"brake_controller_gain": 0.0})
    found = learned(SHEET, drives(PhysicsTruck(driven)))
    assert found.truck.values["brake_controller_gain"] == found.truck.values["brake_gate"] == 0.0


def test_nothing_is_learned_of_a_truck_that_is_as_its_sheet_or_without_a_gear(
    driven: list[Recording],
) -> None:
    without = [replace(r, channels={n: x for n, x in r.channels.items() if n != "gear"}) for r in driven]
    assert learned(SHEET, without) == learned(SHEET, []) and learned(SHEET, []).truck == SHEET
    same = learned(SHEET, drives(PhysicsTruck(SHEET)))
    assert same.truck == SHEET


def test_a_pedal_is_kept_in_the_truck_file_and_refused_where_it_cannot_be(tmp_path: Path) -> None:
    truck = replace(SHEET, pedal=PEDAL)
    assert specification_from_dict(truck.to_dict(), "here") == truck
    for wrong in (((0.0, 100.0), (0.0, 1.2)), ((0.0, 100.0), (0.5, 0.2)), ((100.0, 0.0), (0.0, 1.0))):
        with pytest.raises(InputError, match="rising 'command'"):
            replace(SHEET, pedal=wrong)
    with pytest.raises(InputError, match="engine command in percent"):
        replace(trucks.load("trucksim").specification, pedal=PEDAL)
    file = tmp_path / "truck.yaml"
    file.write_text("engine: {pedal: 3}\n")
    with pytest.raises(InputError, match="lacks"):
        from_file(file)


def test_a_pedal_asks_for_its_share_of_the_torque_there_is() -> None:
    truck = PhysicsTruck(replace(SHEET, pedal=PEDAL))
    plain = PhysicsTruck(SHEET)
    state = truck.reset(np.array([[0.0, 20.0, 5.0]]))
    for _ in range(50):
        state, _ = truck.step(state, np.array([[50.0, 0.0]]), np.zeros((1, 1)))
    inside = truck.inside(state)
    whole = inside["indicated_torque"][0] / 0.35
    again = plain.reset(np.array([[0.0, 20.0, 5.0]]))
    for _ in range(50):
        again, _ = plain.step(again, np.array([[100.0, 0.0]]), np.zeros((1, 1)))
    assert whole == pytest.approx(plain.inside(again)["indicated_torque"][0], rel=0.06)


def test_the_recorded_gear_is_followed_and_a_missing_one_is_chosen() -> None:
    other = PhysicsTruck(SHEET.with_values(SHIFTS))
    (r, _) = drives(other, 400.0)
    follows = simulators.load("truck:volvo?gear=recorded")
    chooses = simulators.load("truck:volvo")
    assert follows.interface.w == ("grade", "gear") and chooses.interface.w == ("grade",)
    w = np.column_stack([r.channels["grade"], r.channels["gear"]])[None]
    own, led = (
        simulators.free_run(truck, r.u[None], conditions, r.y[None, 0])
        for truck, conditions in ((chooses, w[..., :1]), (follows, w))
    )
    alike = [float(np.mean(run.inside["gear"][0] == r.channels["gear"])) for run in (own, led)]
    assert alike[1] > 0.85 and alike[1] > alike[0] + 0.1
    w[..., 1] = np.nan
    unknown = simulators.free_run(follows, r.u[None], w, r.y[None, 0])
    assert np.array_equal(unknown.y, own.y)
    stepped = follows.step(follows.reset(r.y[:1]), r.u[:1], np.array([[0.0, 5.0]]))[0]
    assert follows.inside(stepped)["gear"][0] == 5.0


def test_a_truck_that_follows_is_saved_and_loaded(tmp_path: Path) -> None:
    simulators.load("truck:volvo?gear=recorded").save(tmp_path / "follows")
    assert simulators.load(tmp_path / "follows").interface.gear
    with pytest.raises(InputError, match="no option of a truck"):
        simulators.load("truck:volvo?gear=mine")
