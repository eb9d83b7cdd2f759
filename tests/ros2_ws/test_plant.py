"""The simulated truck between its steps."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest

from deeptruck_core.errors import InputError
from deeptruck_model import simulators
from deeptruck_nodes import roads
from deeptruck_nodes.plant import Plant
from deeptruck_nodes.truck_sim import ticks_a_step


@pytest.fixture(scope="module")
def truck() -> simulators.Simulator:
    return simulators.load("truck:trucksim")


def test_speed_between_two_steps_is_a_straight_line(truck: simulators.Simulator) -> None:
    plant = Plant(truck, roads.parse("flat"), 15.0)
    plant.step(1200.0, 0.0)
    assert plant.speed_at(1.0) == plant.speed
    assert plant.speed_at(0.5) == pytest.approx((15.0 + plant.speed) / 2, abs=1e-9)
    assert plant.speed_at(1e-9) == pytest.approx(15.0, abs=1e-6)


def test_distance_and_road_follow_the_speed(truck: simulators.Simulator) -> None:
    plant = Plant(truck, roads.parse("constant:grade=0.01"), 20.0)
    for _ in range(50):
        plant.step(800.0, 0.0)
    assert plant.distance == pytest.approx(100, rel=0.1)
    assert plant.elevation == pytest.approx(0.01 * plant.distance)
    uphill = plant.speed
    flat = Plant(truck, roads.parse("flat"), 20.0)
    for _ in range(50):
        flat.step(800.0, 0.0)
    assert uphill < flat.speed - 0.3


def test_a_command_that_is_lost_fades_without_a_jerk_and_the_next_one_counts_at_once(
    truck: simulators.Simulator,
) -> None:
    plant, coasting = (Plant(truck, roads.parse("flat"), 20.0) for _ in range(2))
    for _ in range(30):
        plant.step(1800.0, 0.0)
        coasting.step(1800.0, 0.0)
    rates = [plant.acceleration]
    for k in range(1, 31):
        plant.step(math.nan, math.nan)
        coasting.step(max(1800.0 * (1.0 - 0.1 * k), 0.0), 0.0)
        rates.append(plant.acceleration)
    jerks = [(b - a) / plant.dt for a, b in pairwise(rates)]
    assert min(jerks) > -1.0
    assert plant.speed == pytest.approx(coasting.speed)
    plant.step(0.0, 50.0)
    coasting.step(0.0, 50.0)
    assert plant.acceleration == pytest.approx(coasting.acceleration)


def test_status_has_what_the_truck_shows(truck: simulators.Simulator) -> None:
    plant = Plant(truck, roads.parse("flat"), 20.0)
    for _ in range(5):
        plant.step(800.0, 0.0)
    status = plant.status()
    assert all(math.isfinite(status[name]) for name in ("fuel_rate", "gear", "engine_speed", "engine_torque"))


def test_publishing_rate_must_fit_the_step() -> None:
    assert (ticks_a_step(10, 0.1), ticks_a_step(100, 0.1)) == (1, 10)
    for rate in (5, 15, 33):
        with pytest.raises(InputError, match="whole multiple"):
            ticks_a_step(rate, 0.1)


def test_braking_for_a_hazard_goes_on_without_a_command_to_a_standstill(truck: simulators.Simulator) -> None:
    plant = Plant(truck, roads.parse("constant:grade=-0.02"), 20.0)
    for _ in range(10):
        plant.step(0.0, 60.0, 40.0)
    for command in (math.nan, 10.0, 80.0, math.nan):  # a weaker one changes nothing, a stronger one counts
        plant.step(1000.0, command, 40.0)
        assert plant.stopping
    for _ in range(10):
        plant.step(math.nan, math.nan)
    assert plant.acceleration < -4.0
    for _ in range(100):
        plant.step(math.nan, math.nan)
    assert plant.speed == 0.0 and plant.stopping
    plant.step(1000.0, 0.0)  # standing, it obeys the next command
    assert not plant.stopping


@pytest.mark.parametrize(("hazard", "seconds"), [((math.nan, math.inf), 2.0), ((40.0, 1.0), 3.0)])
def test_braking_ends_with_its_command_or_with_the_hazard(
    truck: simulators.Simulator, hazard: tuple[float, float], seconds: float
) -> None:
    plant = Plant(truck, roads.parse("flat"), 20.0)
    for _ in range(10):
        plant.step(0.0, 60.0, *hazard)
    for _ in range(round((seconds - 1.1) * 10)):
        plant.step(math.nan, math.nan)
    assert plant.acceleration < -0.4
    for _ in range(15):
        plant.step(math.nan, math.nan)
    assert not plant.stopping
    assert plant.acceleration > -0.4


def test_a_command_that_names_no_hazard_is_obeyed_again(truck: simulators.Simulator) -> None:
    plant = Plant(truck, roads.parse("flat"), 20.0)
    plant.step(0.0, 60.0, 40.0)
    plant.step(math.nan, math.nan)
    assert plant.stopping
    plant.step(1000.0, 0.0)
    assert not plant.stopping


def test_a_truck_that_is_slow_when_its_hazard_ends_is_braked_to_a_standstill(
    truck: simulators.Simulator,
) -> None:
    """Its idling engine would drive it on."""
    plant = Plant(truck, roads.parse("flat"), 6.0)
    for _ in range(5):
        plant.step(0.0, 60.0, 40.0, 0.2)
    for _ in range(5):
        plant.step(math.nan, math.nan)
    assert 0.0 < plant.speed < 5.0 and plant.stopping
    for _ in range(40):
        plant.step(math.nan, math.nan)
    assert plant.speed == 0.0 and plant.stopping
