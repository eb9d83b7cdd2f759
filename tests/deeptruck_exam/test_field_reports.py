"""The fourth forms, where each has a way of its own; what holds for all is in test_families.py."""

import numpy as np

from deeptruck_exam.field_reports.air import davenport
from deeptruck_exam.field_reports.road import windows


def test_what_needs_a_cause_is_nothing_without_it(alone, held):
    for key in ("chamber_stroke", "green_linings", "timed_trailer_brakes", "out_of_the_slot"):
        np.testing.assert_allclose(held(alone(key), 2.0), 0.0, atol=1e-9)
    assert np.all(held(alone("engine_brake_with_pedal"), 2.0) == 0.0)
    assert np.all(held(alone("one_wheel_on_ice"), 2.0, traction_force=300.0) == 0.0)
    assert np.all(held(alone("four_plays_in_a_row"), 2.0) == 0.0)
    assert np.all(held(alone("full_torque_in_top_gears"), 2.0, engine_torque=200.0) == 0.0)


def test_a_chamber_fills_the_slower_the_gentler(alone, held):
    law = alone("chamber_stroke")
    missing = []
    for share in (0.1, 0.6):
        law.reset(2)
        force = share * law.truck.brake_capacity
        missing.append(held(law, 0.7, brake_force=force)[0] / force)
        assert np.all(held(law, 8.0, brake_force=force) < 0.02 * force)
        assert np.all(held(law, 0.05) < 0.0)
    assert missing[0] > 1.2 * missing[1]


def test_new_linings_fade_once(alone, held):
    law = alone("green_linings")
    first = max(held(law, 10.0, brake_force=4e4)[0] for _ in range(6))
    held(law, 200.0, brake_force=4e4)
    assert first > 0.1 * 4e4 and held(law, 10.0, brake_force=4e4)[0] < 0.3 * first


def test_a_brake_adjusted_hot_drags_when_it_has_cooled(alone, held):
    law = alone("slack_adjusted_hot")
    law.s.drum[:] = law.s.taken[:] = 20.0
    held(law, 40.0, brake_force=4e4)
    hot, cooled = held(law, 0.1)[0], held(law, 90.0)[0]
    assert cooled < -300.0 and hot > 0.2 * cooled


def test_liquid_does_not_follow_at_first(alone, held):
    law = alone("through_swash_plates")
    assert np.all(held(law, 0.02, acceleration=1.0) > 0.2 * 2e4 * 1.0)
    assert np.all(np.abs(law.s.level.sum(axis=0)) < 1e-9)


def test_a_series_of_gusts_has_unit_variance_and_more_power_at_low_frequency():
    series = davenport(np.random.default_rng(3), (4, 4000), 0.2, np.full((4, 1), 40.0))
    np.testing.assert_allclose(series.std(axis=1), 1.0)
    power = np.abs(np.fft.rfft(series, axis=1)) ** 2
    assert power[:, 5:50].mean() > 20.0 * power[:, 500:].mean()


def test_stretches_cover_their_share_of_the_road():
    road = windows(np.random.default_rng(3), 40, 160.0, 0.3)
    assert abs(road.mean() - 0.3) < 0.03 and set(np.unique(road)) == {0.0, 1.0}


def test_what_lies_on_the_road_lies_there_for_both_directions(alone, scene):
    for key, sign in (
        ("sections_by_roughness", 1.0),
        ("snow_drifts", 1.0),
        ("lost_between_map_points", -1.0),
    ):
        law = alone(key)
        law.setting.start_m[:] = [9000.0, 9400.0]
        if key == "snow_drifts":
            law.left[:] = 1.0
        there = law.newtons(scene(distance=200.0), 0.01)
        np.testing.assert_allclose(there[0], sign * there[1])
