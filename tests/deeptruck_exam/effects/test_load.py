"""Loads, where each law has a way of its own. What holds for all is in test_laws.py."""

import numpy as np
import pytest


def test_liquid_does_not_follow_at_first(alone, held):
    law = alone("through_swash_plates")
    assert np.all(held(law, 0.02, acceleration=1.0) > 0.2 * 2e4 * 1.0)
    assert np.all(np.abs(law.s.level.sum(axis=0)) < 1e-9)


def test_a_rope_does_not_push(alone, held):
    law = alone("tow_rope")
    held(law, 30.0)
    assert np.all(held(law, 5.0, acceleration=-1.0, speed=9.0) == 0.0)
    assert min(held(law, 0.5)[0] for _ in range(30)) < -300.0


def test_a_load_over_the_rim_is_lost_for_good(alone, held):
    law = alone("over_the_rim")
    law.hose, law.s.water[:] = (np.full((2, 1), 1e9), np.full((2, 1), 2e9)), 1.0
    full = held(law, 0.1, grade=0.03)
    held(law, 5.0, acceleration=-2.0)
    assert np.all(held(law, 5.0, grade=0.03) > full) and np.all(law.s.water < 0.9)


@pytest.mark.parametrize(
    "key", ["bore_in_the_tank", "rows_of_small_tanks", "swinging_carcasses", "concrete_yields"]
)
def test_a_load_at_rest_stays(key, alone, held):
    np.testing.assert_allclose(held(alone(key), 2.0), 0.0, atol=1e-6)
