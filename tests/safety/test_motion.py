"""Motion of one axis in numbers small enough to check by hand."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from truck_bridge.safety import Axis, Field, Limits
from truck_bridge.safety.motion import Motion, between

LIMITS = Limits((10.0, 20.0), (-50.0, -20.0), (100.0, 40.0), rate=10.0, fade=5.0, jerk=20.0)
AXIS = Axis("a", 1, 0.1, Field(0, 16, 0.01, -300.0, 64255), 0, 1, "none", LIMITS)


@pytest.mark.parametrize(
    ("x", "y"), [(-1, 1), (0, 1), (1, 2), (2, 3), (2.5, 2), (3, 1), (9, 1), (1.999, 2.999), (2.001, 2.998)]
)
def test_between_is_linear_and_constant_outside(x, y):
    assert between(x, (0.0, 2.0, 3.0), (1.0, 3.0, 1.0)) == pytest.approx(y)


def started(demand=0.0, speed=15.0, now=0.1):
    motion = Motion(AXIS)
    motion.start(demand, speed, now)
    return motion


@pytest.mark.parametrize(("speed", "low", "high"), [(5, -50, 100), (15, -35, 70), (25, -20, 40)])
def test_envelope_over_speed(speed, low, high):
    assert started(speed=speed).envelope(speed, 0.1) == (low, high)


def test_envelope_speed_moves_by_12_m_s2_at_most():
    motion = started(speed=15.0)
    assert motion.envelope_speed(30.0, 0.1) == pytest.approx(15 + 1.2)
    assert motion.envelope_speed(0.0, 0.1) == pytest.approx(15 - 1.2)
    assert motion.envelope_speed(15.5, 0.1) == 15.5


@pytest.mark.parametrize(("demand", "start"), [(200.0, 70.0), (-200.0, -35.0), (12.3, 12.3)])
def test_the_start_is_clipped_and_standing_still(demand, start):
    motion = started(demand)
    assert (motion.value, motion.exact, motion.slew, motion.releases) == (start, start, 0.0, 0)


@pytest.mark.parametrize(
    ("now", "elapsed"),
    [(0.0, 0.05), (0.04, 0.05), (0.06, 0.06), (0.1, 0.1), (0.2, 0.2), (0.3, 0.2), (9, 0.2)],
)
def test_elapsed_is_between_half_a_period_and_two(now, elapsed):
    assert started().elapsed(now) == pytest.approx(elapsed)


def test_towards_is_jerk_limited_then_rate_limited_then_slows_down():
    motion, now, demands = started(), 0.1, []
    for _ in range(40):
        demand = motion.towards(10.0, 10.0, 15.0, now)
        motion.took(round((demand + 300.0) / 0.01).to_bytes(8, "little"), 15.0, now)
        demands.append(demand)
        now += 0.1
    steps = [b - a for a, b in zip([0.0, *demands], demands, strict=False)]
    assert steps[0] == pytest.approx(0.2)  # jerk 20: 2/s after 0.1 s
    assert steps[1] == pytest.approx(0.4)
    assert max(steps) == pytest.approx(1.0)  # rate 10
    assert demands[-1] == pytest.approx(10.0)
    assert max(demands) <= 10.0 + 0.05
    assert steps[-2] < 0.05


def test_towards_keeps_inside_the_envelope_and_the_other_way_round():
    for demand, edge in ((500.0, 70.0), (-500.0, -35.0)):
        motion, now = started(edge * 0.99), 0.1
        for _ in range(30):
            value = motion.towards(demand, 10.0, 15.0, now)
            motion.took(round((value + 300.0) / 0.01).to_bytes(8, "little"), 15.0, now)
            assert -35.0 <= value <= 70.0
            now += 0.1
        assert value == pytest.approx(edge)


def test_towards_rest_goes_at_the_fade_rate_and_stops_there():
    for start, sign in ((1.2, 1), (-1.2, -1)):
        motion = started(start)
        expected = [0.7, 0.2, 0.0, 0.0]
        for k, left in enumerate(expected):
            value = motion.towards_rest(15.0, 0.1 + 0.1 * k)
            assert value == pytest.approx(sign * left)
            motion.took(round((value + 300.0) / 0.01).to_bytes(8, "little"), 15.0, 0.1 + 0.1 * k)


def test_towards_rest_comes_back_into_a_narrowed_envelope():
    motion = started(69.0)
    motion.exact = 80.0
    assert motion.towards_rest(15.0, 0.1) == 70.0


@pytest.mark.parametrize(
    ("value", "outside"), [(70.0, False), (70.005, False), (70.006, True), (-35.005, False), (-35.006, True)]
)
def test_outside_means_by_more_than_rounding(value, outside):
    assert started().outside(value, 15.0, 0.1) == outside


@pytest.mark.parametrize(
    ("value", "slew", "why"),
    [
        (11.01, 10.0, ""),
        (11.0102, 10.0, "rate"),
        (8.99, -10.0, ""),
        (8.9898, -10.0, "rate"),
        (10.21, 0.0, ""),
        (10.211, 0.0, "jerk"),
        (9.79, 0.0, ""),
        (9.789, 0.0, "jerk"),
        (10.59, 4.0, ""),
        (10.612, 4.0, "jerk"),
    ],
)
def test_hasty(value, slew, why):
    motion = started(10.0)
    motion.slew = slew
    assert motion.hasty(value, 10.0, 15.0, 0.1) == why


@pytest.mark.parametrize(("value", "why"), [(69.98, "jerk"), (69.995, ""), (-34.98, "jerk"), (-34.995, "")])
def test_jerk_gives_way_at_both_edges(value, why):
    motion = started(value)
    motion.slew = 9.0 if value > 0 else -9.0
    assert motion.hasty(value, 10.0, 15.0, 0.1) == why


@pytest.mark.parametrize(
    ("start", "value", "leaves_fade"),
    [
        (10.0, 10.01, False),
        (10.0, 10.02, True),
        (10.0, 9.49, False),
        (10.0, 9.48, True),
        (-10.0, -10.01, False),
        (-10.0, -10.02, True),
        (-10.0, -9.49, False),
        (0.2, -0.2, False),
        (0.2, -0.22, True),
    ],
)
def test_leaving_in_a_fade(start, value, leaves_fade):
    assert started(start).leaves_fade(value, 0.1) == leaves_fade


@pytest.mark.parametrize(("value", "rest"), [(0.01, True), (-0.01, True), (0.02, False), (-0.02, False)])
def test_at_rest_within_one_bit(value, rest):
    motion = started(value)
    assert motion.at_rest == rest


def test_took_remembers_what_left():
    motion = started(10.0)
    raw = 31_050  # 10.5 on the wire
    data = raw.to_bytes(7, "little") + bytes([0xA7])
    motion.took(data, 30.0, 0.1)
    assert (motion.value, motion.exact) == (10.5, 10.5)
    assert motion.slew == pytest.approx(5.0)
    assert (motion.time, motion.counter, motion.data) == (0.1, 7, data)
    assert motion.speed == pytest.approx(16.2)


def test_took_keeps_the_plan_behind_the_rounding_and_drops_a_foreign_one():
    motion = started(10.0)
    planned = motion.towards(10.2, 10.0, 15.0, 0.1)
    motion.took(round((planned + 300.0) / 0.01).to_bytes(8, "little"), 15.0, 0.1)
    assert motion.exact == planned
    motion.towards(20.0, 10.0, 15.0, 0.2)
    motion.took((31_000).to_bytes(8, "little"), 15.0, 0.2)
    assert motion.exact == motion.value == 10.0


def test_took_a_release_or_no_number_means_rest():
    for data in ((1).to_bytes(8, "little"), (64_256).to_bytes(8, "little")):
        motion = started(10.0)
        motion.took(data, 15.0, 0.1)
        assert motion.value == motion.exact == 0.0
    assert started(10.0).slew == 0.0


def test_a_release_has_no_slew():
    motion = started(10.0)
    motion.took((1).to_bytes(8, "little"), 15.0, 0.1)
    assert motion.slew == 0.0


OFFSET = replace(AXIS, rest=5.0)  # an axis whose demand of nothing is not zero


def test_no_demand_to_start_from_means_rest():
    motion = Motion(OFFSET)
    motion.start(math.nan, 15.0, 0.1)
    assert (motion.value, motion.exact) == (5.0, 5.0)


@pytest.mark.parametrize(("value", "rest"), [(5.0, True), (4.99, True), (5.02, False), (-5.0, False)])
def test_at_rest_means_at_its_own_rest(value, rest):
    motion = Motion(OFFSET)
    motion.start(value, 15.0, 0.1)
    assert motion.at_rest == rest


@pytest.mark.parametrize(
    ("start", "value", "leaves_fade"),
    [(8.0, 7.6, False), (8.0, 8.1, True), (2.0, 2.4, False), (2.0, 1.9, True)],
)
def test_leaving_is_measured_from_its_own_rest(start, value, leaves_fade):
    motion = Motion(OFFSET)
    motion.start(start, 15.0, 0.1)
    assert motion.leaves_fade(value, 0.1) == leaves_fade


def test_slowing_down_leaves_room_to_stop_in_whole_cycles():
    motion = started()
    motion.slew = 5.0
    # 0.15 s, jerk 20: sqrt(1.5^2 + 2 20 1.0) - 1.5 = 5/s
    assert motion.towards(1.0, 10.0, 15.0, 0.15) == pytest.approx(0.75)


@pytest.mark.parametrize(("demand", "step"), [(-30.0, 0.3), (60.0, 0.7)])
def test_turning_round_takes_the_jerk_limit_s_time(demand, step):
    motion = started()
    motion.slew = 5.0
    assert motion.towards(demand, 10.0, 15.0, 0.1) == pytest.approx(step)


def test_a_frame_one_bit_off_the_plan_is_not_the_plan():
    motion = started(10.0)
    motion.towards(10.2, 10.0, 15.0, 0.1)
    motion.took((31_021).to_bytes(8, "little"), 15.0, 0.1)
    assert motion.exact == motion.value == pytest.approx(10.21)
