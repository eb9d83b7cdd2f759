"""Commands, pedals and aids, where each law has a way of its own. What holds for all is in test_laws.py."""

import numpy as np
import pytest


def test_a_pedal_sticks_after_a_rest_and_braking_frees_it(alone, held):
    law = alone("pedal_sticks_where_it_rests")
    full = law.truck.full_command
    held(law, 10.0, u0=0.5 * full)
    assert np.all(held(law, 0.3, u0=0.4 * full) > 500.0)
    assert np.all(held(law, 0.1, u0=0.4 * full, u1=10.0) == 0.0)


@pytest.mark.parametrize("key", ["remembers_a_speed", "override_lingers", "keeps_off_the_leader"])
def test_without_its_cause_there_is_no_force(key, alone, held):
    np.testing.assert_allclose(held(alone(key), 2.0), 0.0, atol=1e-6)


@pytest.mark.parametrize("key", ["command_delay", "command_rate_limit"])
def test_a_filter_leaves_constant_commands_alone(key, between):
    one, u = between(key), np.array([[300.0, 10.0]])
    for k in range(200):
        np.testing.assert_allclose(one.filter(u, k * 0.01, 0.01), u)


def ramp(one, steps, per_step):
    """What a filter gives of commands that rise."""
    return np.array([one.filter(np.full((1, 2), per_step * k), 0.01 * k, 0.01)[0, 0] for k in range(steps)])


def test_commands_over_the_radio_keep_their_order(between):
    given = ramp(between("sent_on_change"), 900, 3.0)
    assert np.all(np.diff(given) >= 0.0) and given[-1] > 3.0 * 700


def test_commands_are_played_in_order_and_all_of_them(between):
    played = ramp(between("playout_buffer"), 3000, 1.0)
    steps = np.diff(played)
    assert steps.min() >= 0.0 and steps.max() <= 2.0 and 2700.0 < played[-1] < 2990.0


def test_commands_come_frame_by_frame(between):
    one = between("slots_of_a_radio")
    played = ramp(one, 3000, 1.0)
    steps, late = np.diff(played), np.arange(3000)[500:] - played[500:]
    assert steps.min() >= 0.0 and np.count_nonzero(steps) < 3000 / one.steps_of + 1
    assert one.base + one.steps_of <= late.min() and late.max() <= one.base + 3 * one.steps_of


def test_a_kick_is_let_in_more_slowly_than_a_press(between):
    given = []
    for steps in (5, 300):
        one = between("kicks_are_doubted")
        for k in range(300):
            out = one.filter(np.array([[0.8 * one.full * min(k / steps, 1.0), 0.0]]), 0.01 * k, 0.01)
        given.append(out[0, 0])
    assert given[0] < 0.8 * given[1]


def test_a_robot_runs_no_faster_than_it_can_and_does_not_overshoot(between):
    one = between("robots_profile")
    one.filter(np.zeros((1, 2)), 0.0, 0.01)
    u = np.array([[0.8 * one.full, 0.0]])
    given = np.array([one.filter(u, 0.01 * k, 0.01)[0, 0] for k in range(3000)]) / one.full
    assert given.max() <= 0.8 + 1e-9 and given[-1] == pytest.approx(0.8)
    assert np.diff(given).max() <= 0.01 * one.p.most_per_s + 3e-4
    assert given[20] < 0.3 * 0.2 * one.p.most_per_s
