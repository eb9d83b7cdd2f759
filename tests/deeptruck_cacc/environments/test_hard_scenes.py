"""Hard scenes are what their descriptions say, row by row."""

from __future__ import annotations

import numpy as np

from deeptruck_cacc.environments import hard_scenes

DT = 0.1


def test_ramps_change_the_leaders_speed_by_3_m_s_up_and_down_every_20_s() -> None:
    pull = hard_scenes.ramps(np.random.default_rng(0), 8, 800, DT).leader_acceleration
    np.testing.assert_array_equal(pull[:, 200:], -pull[:, :-200])
    for way in (-1.0, 1.0):
        np.testing.assert_array_equal((pull[:, :400] == way).sum(axis=1), 30)
    assert set(np.unique(pull)) == {-1.0, 0.0, 1.0}


def test_a_jump_of_the_radar_is_20_to_40_m_and_up_to_3_m_s_for_1_to_3_s_from_20_s_on() -> None:
    scene = hard_scenes.radar_jump(np.random.default_rng(0), 100, 600, DT)
    assert scene.seen_gap_offset is not None and scene.seen_speed_offset is not None
    further, faster = scene.seen_gap_offset, scene.seen_speed_offset
    np.testing.assert_array_equal(further != 0.0, faster != 0.0)
    during = (further != 0.0).sum(axis=1)
    assert 10 <= during.min() <= during.max() <= 30
    for row, steps in enumerate(during):
        assert not further[row, :200].any() and (further[row, 200 : 200 + steps] == further[row, 200]).all()
    assert 20.0 <= further[:, 200].min() <= further[:, 200].max() <= 40.0
    assert 0.0 <= faster[:, 200].min() <= faster[:, 200].max() <= 3.0
