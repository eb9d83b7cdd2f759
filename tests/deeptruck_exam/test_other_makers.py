"""The third forms, where each has a way of its own; what holds for all is in test_families.py."""

import numpy as np


def test_what_needs_a_cause_is_nothing_without_it(alone, held):
    assert np.all(held(alone("pads_stay_on"), 2.0) == 0.0)
    assert np.all(held(alone("long_pipes"), 2.0) == 0.0)
    assert np.all(held(alone("soaking_heat"), 2.0) == 0.0)
    assert np.all(held(alone("speed_held_downhill"), 2.0) == 0.0)
    assert np.all(held(alone("axle_torque_limit"), 2.0, traction_force=500.0) == 0.0)
    np.testing.assert_allclose(held(alone("pocket_behind_leader"), 2.0), 0.0, atol=1e-9)
    assert np.all(held(alone("dogs_miss"), 2.0) == 0.0)
    assert np.all(held(alone("stuck_after_standing"), 2.0) == 0.0)
    assert np.all(held(alone("overboost"), 2.0, engine_torque=200.0) == 0.0)
    np.testing.assert_allclose(held(alone("freewheeling_rotor"), 2.0), 0.0, atol=5.0)
    np.testing.assert_allclose(held(alone("bore_in_the_tank"), 2.0), 0.0, atol=1e-6)
    np.testing.assert_allclose(held(alone("two_masses_and_play"), 9.0), 0.0, atol=80.0)


def test_what_has_a_cause_acts(alone, held):
    law = alone("pads_stay_on")
    held(law, 1.0, brake_force=2e4)
    dragging = held(law, 0.01)
    assert np.all(dragging < -500.0) and np.all(held(law, 120.0) > 0.5 * dragging)
    law = alone("soaking_heat")
    early, late = held(law, 1.0, brake_force=1e4), held(law, 100.0, brake_force=3e4)
    assert np.all(early < 1.0) and np.all(late > 0.08 * 3e4)
    law = alone("speed_held_downhill")
    shut = {"u0": 0.0, "engine_torque": -100.0}
    first = held(law, 3.0, **shut)
    assert np.all(held(law, 3.0, **shut, speed=17.0) < first) and np.all(first < 0.0)
    law = alone("stuck_after_standing")
    held(law, 6.0, speed=0.0)
    assert np.all(held(law, 0.1, speed=1.0) < -0.02 * 2e4 * 9.81)
    assert np.all(held(law, 60.0, speed=10.0) > -50.0)
    law = alone("floating_ice")
    slow, resonant, fast = (held(law, 60.0, speed=v) for v in (2.0, 9.5, 22.0))
    assert np.all(resonant < 5.0 * slow) and np.all(resonant < 5.0 * fast)
    law = alone("bearing_runs_hot")
    assert np.all(held(law, 90.0, speed=22.0) < 3.0 * held(law, 300.0, speed=8.0))


def test_a_rotor_takes_and_does_not_give_back(alone, held):
    law = alone("freewheeling_rotor")
    held(law, 0.1, speed=10.0)
    assert np.all(held(law, 0.2, speed=12.0) < -500.0)
    assert np.all(held(law, 0.2, speed=8.0) == 0.0)


def test_stretches_lie_on_the_road_and_slopes_keep_their_height(alone, scene):
    for key in ("soft_ground", "tangents_not_in_the_map"):
        law = alone(key)
        assert (law.road != 0.0).mean() > 0.2
        law.setting.start_m[:] = [9000.0, 9400.0]
        there = law.newtons(scene(distance=200.0), 0.01)
        np.testing.assert_allclose(there[0], there[1] * (1.0 if key == "soft_ground" else -1.0))
