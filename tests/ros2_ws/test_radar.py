"""The gap a leader opens, and what the radar makes of it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from deeptruck_cacc.environments.hard_scenes import long_following
from deeptruck_nodes import leaders
from deeptruck_nodes.radar import Gap, Radar, RadarErrors
from deeptruck_nodes.runs import RADARS


def readings(errors: RadarErrors, seed: int = 1, seconds: float = 100.0, dt: float = 0.1) -> np.ndarray:
    radar = Radar(errors, seed)
    return np.array([radar.sense(k * dt, 50.0, 20.0) for k in range(round(seconds / dt))])


def test_gap_is_the_integral_of_the_closing_speed() -> None:
    gap = Gap(leaders.parse("constant:speed=20"), 30.0, 2.0)
    for k in range(101):  # the truck brakes from 25 m/s at 1 m/s^2: exact for the trapezoidal rule
        gap.update(0.1 * k, 25 - 0.1 * k)
    assert gap.gap == pytest.approx(30 + (20 - 25) * 10 + 0.5 * 10**2)


def test_gap_starts_at_the_time_gap_where_none_is_given_and_bridges_an_invalid_speed() -> None:
    gap = Gap(leaders.parse("constant:speed=20"), 0.0, 2.0)
    gap.update(0.0, math.nan)
    assert math.isnan(gap.gap)
    gap.update(0.1, 18.0)
    assert gap.gap == 36.0
    gap.update(0.2, math.nan)
    gap.update(0.3, 18.0)
    assert gap.gap == pytest.approx(36.0 + 2.0 * 0.2)


def test_a_clean_radar_tells_the_truth() -> None:
    assert np.all(readings(RadarErrors()) == [50.0, 20.0])


def test_noise_has_the_stated_size_and_repeats_by_seed() -> None:
    errors = RadarErrors(range_noise=0.5, speed_noise=0.1)
    seen = readings(errors)
    assert seen.std(axis=0) == pytest.approx([0.5, 0.1], rel=0.1)
    assert np.array_equal(seen, readings(errors)) and not np.array_equal(seen, readings(errors, seed=2))


def test_dropouts_come_as_often_and_last_as_long_as_stated() -> None:
    seen = readings(RadarErrors(dropout_rate=0.1, dropout_s=0.5), seconds=5000)
    lost = np.isinf(seen[:, 0])
    assert np.array_equal(lost, np.isnan(seen[:, 1]))
    begins = np.count_nonzero(lost[1:] & ~lost[:-1])
    assert begins / 5000 == pytest.approx(0.1, rel=0.15)
    assert lost.mean() == pytest.approx(0.1 * 0.5, rel=0.25)


def test_the_lane_change_jumps_to_a_farther_vehicle_and_back() -> None:
    seen = readings(RadarErrors(lane_change_at_s=63.0))
    jumped = seen[:, 0] == 80.0
    assert np.flatnonzero(jumped)[[0, -1]] * 0.1 == pytest.approx([63.0, 64.9])
    assert np.all(seen[jumped, 1] == 21.5) and np.all(seen[~jumped] == [50.0, 20.0])


def test_a_lost_radar_sees_nothing_for_as_long_as_stated() -> None:
    lost = np.isinf(readings(RadarErrors(lost_at_s=20.0, lost_for_s=6.0))[:, 0])
    assert np.array_equal(np.flatnonzero(lost), np.arange(200, 260))


def test_the_leader_node_and_the_scene_change_lanes_alike() -> None:
    scene = long_following(np.random.default_rng(0), 1, 1200, 0.1)
    offsets = np.array([scene.seen_gap_offset[0], scene.seen_speed_offset[0]]).T
    clean = dict.fromkeys(("range_noise", "speed_noise", "dropout_rate"), 0.0)
    seen = readings(RadarErrors(**RADARS["field"] | clean), seconds=120.0)
    np.testing.assert_allclose(seen - [50.0, 20.0], offsets)


def test_beyond_its_reach_and_behind_a_collision_it_sees_nothing() -> None:
    radar = Radar(RadarErrors(reach=40.0), 0)
    assert radar.sense(0.0, 50.0, 20.0)[0] == math.inf
    assert radar.sense(0.1, -1.0, 20.0)[0] == math.inf
    assert radar.sense(0.2, 39.0, 20.0) == (39.0, 20.0)
