from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from deeptruck_cacc.controllers.approach import approach, cruise
from deeptruck_cacc.controllers.baselines import LAWS, baseline
from deeptruck_cacc.environments.hard_scenes import settled
from deeptruck_cacc.environments.rollouts import roll_out
from deeptruck_model import simulators


@pytest.mark.parametrize("name", LAWS)
@pytest.mark.parametrize("truck", ["trucksim", "freightliner"])
def test_a_leader_far_ahead_is_approached_without_braking_hard(truck: str, name: str) -> None:
    """40 m behind its gap each closes in, overshoots by 4 m at most and slows down by 1 m/s^2 at most."""
    simulator = simulators.load(f"truck:{truck}")
    scene = replace(settled(1, 600, 18.0, 2.0), gap=np.array([76.0]))
    trace = roll_out(simulator, baseline(name, simulator.interface), scene)
    assert np.diff(trace["speed"][:, 0]).min() > -0.1
    assert trace["gap"][-1, 0] < 45.0 and trace["gap"].min() > 32.0


@pytest.mark.parametrize("name", LAWS)
def test_a_truck_that_stands_nearer_than_wanted_brakes(name: str) -> None:
    """A time gap is that of 0.5 m/s there: 12 s are 6 m, as the guard asks for."""
    driver = baseline(name, simulators.load("truck:trucksim").interface)
    standing = {"leader_speed": 0.0, "speed": 0.0, "gap": 3.4, "target_time_gap": 12.0}
    engine, brake = driver.act({n: np.array([x]) for n, x in standing.items()})
    assert engine[0] == driver.pedals.scale.engine_low and brake[0] > 0.0


def test_what_a_truck_that_is_held_does_not_give_is_not_summed_up() -> None:
    driver = baseline("acc", simulators.load("truck:trucksim").interface)
    held = {"leader_speed": 1.0, "speed": 0.0, "gap": 8.0, "target_time_gap": 12.0}
    engines = [driver.act({n: np.array([x]) for n, x in held.items()})[0][0] for _ in range(100)]
    assert engines[0] > driver.pedals.scale.engine_low and np.ptp(engines) == 0.0


@pytest.mark.parametrize("grade", [-0.06, 0.0, 0.06])
@pytest.mark.parametrize("truck", ["trucksim", "volvo"])
def test_behind_a_standing_leader_the_brake_alone_holds(truck: str, grade: float) -> None:
    driver = baseline("acc", simulators.load(f"truck:{truck}").interface)
    for speed, gap in ((1.5, 9.0), (0.5, 7.0), (0.1, 6.5), (0.0, 6.0), (0.0, 9.0)):
        seen = {"leader_speed": 0.02, "gap": gap, "speed": speed, "grade": grade, "target_time_gap": 12.0}
        engine, brake = driver.act({name: np.array([value]) for name, value in seen.items()})
        assert engine[0] == driver.pedals.scale.engine_low
    # 0.6 m/s^2 beyond the slope, of the 4.5 that the nominal map gives
    assert brake[0] >= (0.6 + 9.8 * abs(grade) - 0.2) / 4.6 * driver.pedals.scale.brake_high
    driver.act({**{name: np.array([value]) for name, value in seen.items()}, "leader_speed": np.array([3.0])})
    moving = {**seen, "leader_speed": 3.0, "gap": 12.0}
    for _ in range(20):
        engine, brake = driver.act({name: np.array([value]) for name, value in moving.items()})
    assert engine[0] > driver.pedals.scale.engine_low and brake[0] == 0.0


RATE = 1.0


@pytest.mark.parametrize("begin", [-60.0, 40.0])  # a cut-in, a leader far ahead
def test_from_far_off_it_comes_back_at_no_more_than_the_rate(begin):
    far, time_gap, dt = np.array([begin]), np.array([2.0]), 0.01
    sizes, rates = [], []
    for _ in range(3000):
        above, slope = approach(far, time_gap, RATE)
        far = far - dt * above
        sizes.append(abs(far[0]))
        rates.append(abs(slope[0] * above[0]))  # the leader steady, far changes by -above
    assert max(rates) == pytest.approx(RATE)
    assert np.all(np.diff(sizes) <= 0) and sizes[-1] < 0.01
    assert np.sqrt(2 * RATE * abs(begin)) > abs(approach(np.array([begin]), time_gap, RATE)[0][0])


def test_torch_gives_the_same_and_a_gradient():
    far, time_gap = np.linspace(-80.0, 80.0, 33), np.linspace(1.0, 5.0, 33)
    told = torch.tensor(far, requires_grad=True)
    above, slope = approach(told, torch.tensor(time_gap), RATE)
    expected = approach(far, time_gap, RATE)
    np.testing.assert_allclose(above.detach(), expected[0])
    above.sum().backward()
    np.testing.assert_allclose(told.grad, expected[1])  # the slope is the slope
    np.testing.assert_allclose(slope.detach(), expected[1])
    assert np.isnan(approach(np.array([np.nan]), np.array([2.0]), RATE)[0]).all()


def test_nobody_is_followed_faster_than_the_set_speed():
    seen = {"leader_speed": np.array([20.0, 33.0, 20.0]), "gap": np.array([30.0, 60.0, 90.0])}
    led = cruise({**seen, "target_time_gap": np.full(3, 2.0)}, 25.0)
    np.testing.assert_array_equal(led["leader_speed"], [20.0, 25.0, 20.0])
    np.testing.assert_array_equal(led["gap"], [30.0, 50.0, 50.0])
    assert (cruise({**seen, "target_time_gap": 2.0}, np.inf)["gap"] == seen["gap"]).all()
