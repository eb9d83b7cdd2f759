"""Rest, hills and gear changes: no jitter, no hunting."""

from __future__ import annotations

import numpy as np
import pytest

from deeptruck_model import trucks
from deeptruck_model.simulators import Run
from deeptruck_model.trucks.driver import EPISODE, LOGGED, drive_along


def run(
    name: str, seconds: float, start: float, engine: float, brake: float, grade: float, **changes: float
) -> Run:
    truck = trucks.load(name).with_grade_input().with_parameters(changes)
    n = int(seconds * 10) + 1
    u = np.tile([engine, brake], (1, n, 1))
    return truck.rollout(u, np.full((1, n, 1), grade), np.array([[0.0, start, 0.0]]))


@pytest.mark.parametrize("grade", [-0.08, 0.0, 0.08])
@pytest.mark.parametrize("name", trucks.pool())
def test_brakes_hold_exactly(name: str, grade: float) -> None:
    brake = 3.0 if name == "volvo" else 60.0
    y = run(name, 60.0, 6.0, 0.0, brake, grade, hill_hold=0).y[0]
    stop = int(np.argmax(y[:, 1] == 0.0))
    assert 0 < stop < 80
    np.testing.assert_array_equal(y[stop + 1 :, :2], 0.0)


def test_a_deceleration_that_the_brakes_add_is_no_less_with_more_load() -> None:
    light, heavy = (
        run("volvo", 4.0, 20.0, 0.0, 2.0, 0.0, brake_controller_gain=0.0, mass=mass).y[0, 20:, 0].mean()
        for mass in (20_000.0, 30_000.0)
    )
    assert -2.4 < light < -2.0 and heavy == pytest.approx(light, abs=0.1)


def test_the_clutch_opens_where_it_brakes_with_the_torque_of_idling() -> None:
    """Logs show the torque that accessories and friction take at idle; it is no demand to move."""
    done = run("trucksim", 15.0, 6.0, 150.0, 60.0, 0.0)
    stop = int(np.argmax(done.y[0, :, 1] == 0.0))
    assert 0 < stop < 80
    np.testing.assert_array_equal(done.y[0, stop:, 1], 0.0)
    assert done.inside["engine_speed"][0].min() > 50.0
    assert done.inside["clutch"][0, -1] == 0.0


def test_an_automatic_creeps_and_a_clutch_does_not() -> None:
    assert 0.5 < run("freightliner", 30.0, 0.0, 0.0, 0.0, 0.0).y[0, -1, 1] < 4.0
    np.testing.assert_array_equal(run("trucksim", 30.0, 0.0, 0.0, 0.0, 0.0).y[0, :, 1], 0.0)


@pytest.mark.parametrize("name", trucks.pool())
def test_gears_do_not_hunt_at_a_steady_speed(name: str) -> None:
    """A driver holds a speed on a slope: once settled, the gearbox has nothing to do."""
    truck = trucks.load(name)
    n, none = 3000, np.zeros(0, EPISODE)
    for speed in (5.0, 9.0, 14.0, 20.0, 25.0):
        for grade in (-0.02, 0.0, 0.02, 0.04):
            road = np.full(1000, grade)
            log = drive_along(truck, np.full(n, speed), np.zeros(n), none, road, 100.0)
            changes = (np.diff(log[n // 2 :, LOGGED.index("gear")]) != 0.0).sum()
            assert changes <= 2, f"{changes} changes at {speed:g} m/s on {grade:.0%}"


def test_volvo_reaches_the_deceleration_it_is_asked_for() -> None:
    for mass in (15000.0, 30000.0):
        for request in (0.8, 2.0):
            run_ = run("volvo", 6.0, 25.0, 0.0, request, 0.02, mass=mass)
            assert -run_.y[0, 30:50, 0].mean() == pytest.approx(request, rel=0.06)
    assert run("volvo", 3.0, 25.0, 0.0, 0.04, 0.0).inside["front_pressure"].max() == 0.0  # switch open


def test_forced_speed_keeps_gear_and_turns_the_engine() -> None:
    truck = trucks.load("trucksim")
    state = truck.reset(np.array([[0.0, 20.0, 5.0]]))
    gear = truck.inside(state)["gear"].copy()
    forced = truck.force(state, np.array([[0.3, 20.5, 5.0]]))
    inside = truck.inside(forced)
    np.testing.assert_array_equal(inside["gear"], gear)
    np.testing.assert_allclose(inside["engine_speed"], inside["ratio"] * 20.5 / 0.5)
    np.testing.assert_array_equal(truck.inside(state)["engine_speed"], inside["ratio"] * 20.0 / 0.5)
