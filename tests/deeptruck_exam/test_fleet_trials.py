"""The fifth forms, where each has a way of its own; what holds for all is in test_families.py."""

from itertools import pairwise
from types import SimpleNamespace

import numpy as np

from deeptruck_exam.effects import EFFECTS
from deeptruck_exam.fleet_trials.air import SAMPLE_S, arrivals
from deeptruck_exam.fleet_trials.road import CELL_M, CELLS, stretches
from deeptruck_exam.fleet_trials.world import draw_pass, swell


def test_what_needs_a_cause_is_nothing_without_it(alone, held):
    for key in (
        "wake_blown_aside",
        "hot_bands",
        "tanks_run_low",
        "stages_by_acceleration",
        "retarder_sheds_heat",
        "rows_of_small_tanks",
        "swinging_carcasses",
        "cam_hysteresis",
        "hole_in_the_blending",
        "antilock_is_fooled",
        "engine_has_to_restart",
        "eases_before_the_crest",
        "acceleration_management",
        "gearbox_brake_in_cold_oil",
    ):
        np.testing.assert_allclose(held(alone(key), 2.0), 0.0, atol=1e-9)
    np.testing.assert_allclose(held(alone("manifold_goes_cold"), 2.0, engine_torque=100.0), 0.0, atol=1e-9)


def test_bands_need_speed_and_heat_and_stay_for_a_while(alone, held):
    law = alone("hot_bands")
    slow = held(law, 60.0, brake_force=3e4, speed=3.0)
    assert np.all(slow < 0.02 * 3e4)
    fast = held(law, 60.0, brake_force=3e4, speed=18.0)
    assert np.all(fast > 0.15 * 3e4)
    assert np.all(held(law, 3.0, brake_force=3e4, speed=3.0) > 0.5 * fast)


def test_brakes_are_the_slower_the_emptier_their_tanks(alone, held):
    missing = []
    for tank in (1.0, 0.4):
        law = alone("tanks_run_low")
        law.s.tank[:] = tank
        missing.append(held(law, 0.5, brake_force=4e4)[0])
    assert missing[1] > 1.1 * missing[0] > 0.0


def test_frozen_shoes_thaw_on_the_way(alone, held):
    law = alone("shoes_frozen_on")
    first, later = held(law, 0.1), held(law, 300.0)
    assert np.all(first < -500.0) and np.all(later > 0.2 * first)


def test_a_turbine_is_slower_after_a_hill(alone, held):
    lacking = []
    for torque in (1500.0, -100.0):
        law = alone("manifold_goes_cold")
        held(law, 40.0, engine_torque=torque)
        held(law, 4.0, engine_torque=150.0)
        lacking.append(held(law, 1.0, engine_torque=1600.0)[0])
    assert lacking[1] < lacking[0] < 0.0


def test_a_full_truck_does_not_meet_the_limit_of_acceleration(alone, held):
    law = alone("acceleration_management")
    assert np.all(held(law, 3.0, acceleration=0.1, speed=8.0) == 0.0)
    assert np.all(held(law, 3.0, acceleration=0.8, speed=8.0) < -1000.0)


def test_lash_is_crossed_sooner_in_a_high_gear(alone, held):
    waits = []
    for ratio in (4.0, 30.0):
        law = alone("lash_by_the_gear")
        held(law, 1.0, traction_force=-2000.0, engine_torque=-80.0, ratio=ratio)
        steps = 0
        while held(law, 0.01, ratio=ratio)[0] < -4000.0:
            steps += 1
        waits.append(steps)
    assert 0 < waits[0] < waits[1] < 200


def test_a_rope_does_not_push(alone, held):
    law = alone("tow_rope")
    held(law, 30.0)
    assert np.all(held(law, 5.0, acceleration=-1.0, speed=9.0) == 0.0)
    assert min(held(law, 0.5)[0] for _ in range(30)) < -300.0


def test_more_is_braked_on_the_way_down_than_on_the_way_up(alone, held):
    law = alone("cam_hysteresis")
    up = held(law, 1.0, brake_force=1e4)
    held(law, 1.0, brake_force=3e4)
    assert np.all(up == 0.0) and np.all(held(law, 0.1, brake_force=1e4) < -3000.0)
    assert np.all(held(law, 5.0) > -50.0)


def test_slopes_of_an_outage_begin_at_nothing_from_either_side(alone, scene):
    law = alone("grade_held_in_outages")
    there, back = law.road[:, 0]
    inside = there != 0.0
    assert 0.2 < inside.mean() < 0.95 and np.abs(law.road).max() < 0.06
    assert not np.array_equal(there, back)
    law.setting.start_m[:] = [9000.0, 9400.0]
    assert law.newtons(scene(distance=200.0), 0.01).shape == (2,)


def test_what_lies_on_the_road_lies_there_for_both_directions(alone, scene):
    for key in ("washboard", "chippings"):
        law = alone(key)
        law.setting.start_m[:] = [9000.0, 9400.0]
        if key == "chippings":
            law.left[:] = 1.0
        there = law.newtons(scene(distance=200.0), 0.01)
        np.testing.assert_allclose(there[0], there[1])


def test_stretches_do_not_overlap_and_gusts_have_unit_mean():
    rng = np.random.default_rng(3)
    lie = stretches(rng, (50.0, 200.0), (100.0, 400.0))
    assert all(a[1] <= b[0] + 1 for a, b in pairwise(lie))
    assert max(last for _, last in lie) <= CELLS and 0.4 < CELL_M * sum(b - a for a, b in lie) / 62000.0 < 0.9
    gusts = arrivals(rng, (4, round(2000.0 / SAMPLE_S)), 6.0, 8.0)
    assert gusts.min() >= 0.0 and abs(gusts.mean() - 1.0) < 0.15


def test_commands_over_the_radio_keep_their_order(planted):
    parts, _ = planted(EFFECTS["sent_on_change"])
    (link,) = parts.filters
    link.reset(2)
    rising = [link.filter(np.full((2, 2), 3.0 * k), 0.01 * k, 0.01)[0, 0] for k in range(900)]
    assert np.all(np.diff(rising) >= 0.0) and rising[-1] > 3.0 * 700


def test_faults_keep_their_word():
    rng, time = np.random.default_rng(1), np.arange(1200) * 0.1
    p = SimpleNamespace(sign=1.0, scale=0.06, from_mps=4.0, bias=0.2, takes=0.5, sticks=0.002)
    setting = SimpleNamespace()
    speed = np.clip(time - 40.0, 0.0, 20.0)
    for key, name in (("handover_between_sensors", "speed"), ("sticking_pendulum", "grade")):
        channels = {"speed": speed.copy(), "grade": 0.02 * np.sin(time / 9.0)}
        true = channels[name].copy()
        (fault,) = EFFECTS[key].build(setting, p).faults
        fault(channels, 0.1, rng)
        off = channels[name] - true
        if name == "speed":
            assert np.all(off[speed < 4.0] == 0.0) and np.isclose(off[-1], 0.06 * speed[-1])
        else:
            assert np.all(np.abs(off - 0.2) <= 0.002 + 1e-12) and np.ptp(off) > 0.003


def test_the_land_swells_and_a_pass_goes_down():
    rng = np.random.default_rng(5)
    land = swell(rng, 2000.0, 0.3)
    assert np.isclose(land.std(), 1.0) and np.abs(np.diff(land)).max() < 0.3
    down = draw_pass(rng)
    assert -0.08 < down.min() < down.max() < -0.01 and -0.06 < down.mean() < -0.04
