"""Rest, hills and gear changes: no jitter, no hunting."""

from __future__ import annotations

import numpy as np
import pytest

from deeptruck_core.errors import InputError
from deeptruck_model import trucks
from deeptruck_model.simulators import Run, free_run
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


# Forces and command filters from outside the package


class Push:
    """A constant force that counts its own time."""

    def __init__(self, newton: float) -> None:
        self.newton = newton

    def reset(self, batch: int) -> None:
        self.seconds = np.zeros(batch)

    def force(self, view: trucks.View, dt: float) -> np.ndarray:
        self.seconds += dt
        return np.full(len(self.seconds), self.newton)


class Delay:
    """Commands arrive later."""

    def __init__(self, seconds: float) -> None:
        self.seconds = seconds

    def reset(self, batch: int) -> None:
        self.waiting: list[np.ndarray] = []

    def filter(self, u: np.ndarray, time: float, dt: float) -> np.ndarray:
        self.waiting.append(u.copy())
        return self.waiting.pop(0) if len(self.waiting) * dt > self.seconds + 0.5 * dt else np.zeros_like(u)


def pull_away(truck: trucks.PhysicsTruck, steps: int = 200) -> np.ndarray:
    u = np.tile([1200.0, 0.0], (2, steps, 1))
    return free_run(truck, u, np.zeros((2, steps, 1)), np.array([[0.0, 10.0, 0.0], [0.0, 20.0, 0.0]])).y


def test_a_force_accelerates_by_effective_mass() -> None:
    truck = trucks.load("trucksim").with_parameters({"final_drive": 3.7})
    u, w = np.zeros((1, 2)), np.zeros((1, 1))
    plain, pushed = (t.reset(np.array([[0.0, 22.0]])) for t in (truck, truck.with_forces([Push(5000.0)])))
    _, y = truck.step(plain, u, w)
    after, y_pushed = truck.with_forces([Push(5000.0)]).step(pushed, u, w)
    gain = 5000.0 / truck.inside(after)["effective_mass"]
    np.testing.assert_allclose(y_pushed[:, 0] - y[:, 0], gain, rtol=2e-3)
    np.testing.assert_array_equal(truck.inside(after)["external_force"], 5000.0)


def test_a_force_moves_a_truck_at_rest_only_against_what_holds_it() -> None:
    held = trucks.load("trucksim").with_forces([Push(1000.0)])
    moved = trucks.load("trucksim").with_forces([Push(2000.0)])  # rolling resistance is 1,177 N
    u, w, y0 = np.zeros((1, 50, 2)), np.zeros((1, 50, 1)), np.zeros((1, 3))
    np.testing.assert_array_equal(held.rollout(u, w, y0).y[..., 1], 0.0)
    assert moved.rollout(u, w, y0).y[0, -1, 1] > 0.1


def test_a_command_filter_delays() -> None:
    truck = trucks.load("trucksim")
    late = pull_away(truck.with_forces([], [Delay(1.0)]))
    coast = free_run(truck, np.zeros((2, 200, 2)), np.zeros((2, 200, 1)), late[:, 0]).y
    np.testing.assert_array_equal(late[:, :10], coast[:, :10])
    assert (late[:, 25, 1] > coast[:, 25, 1]).all()


def test_rollout_equals_steps_with_forces_and_filters() -> None:
    truck = trucks.load("trucksim").with_forces([Push(900.0)], [Delay(0.3)])
    y = pull_away(truck, 60)
    state = truck.reset(y[:, 0])
    for k in range(59):
        state, now = truck.step(state, np.tile([1200.0, 0.0], (2, 1)), np.zeros((2, 1)))
        np.testing.assert_array_equal(now, y[:, k + 1])


class Wrong:
    def reset(self, batch: int) -> None: ...

    def force(self, view: trucks.View, dt: float) -> np.ndarray:
        return np.zeros(3)


class NotANumber(Push):
    def force(self, view: trucks.View, dt: float) -> np.ndarray:
        return np.full(len(self.seconds), np.nan)


@pytest.mark.parametrize(("force", "says"), [(Wrong(), "shape"), (NotANumber(0.0), "not a finite")])
def test_a_broken_force_is_refused(force: trucks.Force, says: str) -> None:
    truck = trucks.load("trucksim").with_forces([force])
    with pytest.raises(InputError, match=says):
        truck.step(truck.reset(np.array([[0.0, 15.0]])), np.zeros((1, 2)), np.zeros((1, 1)))


def test_force_state_is_copied_with_the_truck_state() -> None:
    truck = trucks.load("trucksim").with_forces([Push(100.0)])
    state = truck.reset(np.array([[0.0, 15.0]]))
    u, w = np.array([[500.0, 0.0]]), np.zeros((1, 1))
    later, first = truck.step(state, u, w)
    _, again = truck.step(state, u, w)
    np.testing.assert_array_equal(first, again)
    assert isinstance(state.forces[0], Push)
    assert isinstance(later.forces[0], Push)
    assert state.forces[0].seconds[0] == 0.0
    assert later.forces[0].seconds[0] == pytest.approx(0.1)
