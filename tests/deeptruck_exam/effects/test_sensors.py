"""Faults of the measurement, where each has a way of its own. What holds for all is in test_laws.py."""

import numpy as np

TIME = np.arange(1200) * 0.1


def test_one_sensor_hands_over_to_another_at_a_speed(spoilt):
    speed = np.clip(TIME - 40.0, 0.0, 20.0)
    off = spoilt("handover_between_sensors", {"speed": speed}, scale=0.06, from_mps=4.0)["speed"] - speed
    assert np.all(off[speed < 4.0] == 0.0) and np.isclose(off[-1], 0.06 * speed[-1])


def test_a_pendulum_sticks(spoilt):
    grade = 0.02 * np.sin(TIME / 9.0)
    off = spoilt("sticking_pendulum", {"grade": grade}, bias=0.2, sticks=0.002)["grade"] - grade
    assert np.all(np.abs(off - 0.2) <= 0.002 + 1e-12) and np.ptp(off) > 0.003


def test_a_delay_by_the_way_falls_with_speed(spoilt):
    channels = {"acceleration": TIME[:600], "speed": np.repeat([6.0, 20.0], 300)}
    off = TIME[:600] - spoilt("stamped_by_the_way", channels, late_s=0.3, metres=6.0)["acceleration"]
    np.testing.assert_allclose(off[[100, 500]], [1.3, 0.6])


def test_the_mean_of_two_wheels_is_off_by_half(spoilt):
    speed = np.repeat([6.0, 20.0], 300)
    share = (
        spoilt("one_of_two_wheels", {"speed": speed}, scale=0.06, shared=0.5, stays_s=20.0)["speed"] / speed
        - 1.0
    )
    assert 0.029 < share.min() < 0.031 and 0.059 < share.max() < 0.061


def test_a_slewed_clock_comes_nearer(spoilt):
    time = np.arange(2400) * 0.1
    off = time - spoilt("slewed_clock", {"acceleration": time}, late_s=0.6, slews=0.002)["acceleration"]
    assert 0.45 < off[100] < 0.75 and off[2300] < off[100] - 0.1


def test_a_barometer_at_one_speed_has_its_mounting_error_alone(spoilt):
    channels = {"speed": np.full(600, 20.0), "grade": np.zeros(600)}
    grade = spoilt("barometer_in_the_wind", channels, bias=0.01, port_m=5.0, lag_s=0.5)["grade"]
    np.testing.assert_allclose(grade, 0.01)
