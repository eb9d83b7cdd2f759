from __future__ import annotations

import numpy as np
import pytest
import torch

from deeptruck_cacc.controllers.approach import approach, cruise

RATE = 1.0


def test_near_the_right_gap_the_time_gap_itself_is_right():
    far, time_gap = np.array([-8.9, -2.0, 0.0, 2.0, 8.9]), 3.0
    above, slope = approach(far, np.full(5, time_gap), RATE)
    np.testing.assert_allclose(above, far / time_gap)
    np.testing.assert_allclose(slope, 1 / time_gap)


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
