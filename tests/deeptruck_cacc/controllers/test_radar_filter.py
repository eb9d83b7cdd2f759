"""What the filter takes from a noisy radar, and what it must not take."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from deeptruck_cacc import MlpPolicy
from deeptruck_cacc.controllers.pedals import PedalMap
from deeptruck_cacc.controllers.radar_filter import RadarFilter
from deeptruck_cacc.controllers.scaling import ActionScale, FeatureMap
from deeptruck_cacc.environments import scenes
from deeptruck_cacc.environments.rollouts import roll_out
from deeptruck_cacc.safety.guard import guard
from deeptruck_cacc.training.network import SeedBatch

DT, RADAR = 0.1, RadarFilter.steady()


def drive(pull: np.ndarray, noise: tuple[float, float], jump: np.ndarray | float = 0.0) -> np.ndarray:
    """True and estimated gap and leader speed, (4, T), behind a leader of this acceleration (T,), at 18 m/s.

    The truck itself swings by 1 m/s: the filter knows that.
    """
    rng, steps = np.random.default_rng(0), len(pull)
    speed = 18 + np.sin(0.5 * DT * np.arange(steps))
    leader = 18 + DT * np.append(0.0, np.cumsum(pull[:-1]))
    gap = 40 + DT * np.append(0.0, np.cumsum((leader - speed)[:-1])) + jump
    track, rows = np.full((1, 3), np.nan), []
    for k in range(steps):
        seen = np.array([leader[k], speed[k], gap[k], 36.0, 0.0])
        seen[[0, 2]] += rng.normal(0, 1, 2) * (noise[1], noise[0])
        likely, track = RADAR(seen[None], track)
        rows.append([gap[k], leader[k], likely[0, 2], likely[0, 0]])
    return np.array(rows).T


def test_the_gain_is_where_the_riccati_recursion_settles():
    step, seen = np.eye(3) + DT * np.eye(3, k=1), np.eye(2, 3)
    noise, wander = np.diag([0.1**2, 0.05**2]), np.diag([0.0, 0.0, 0.1**2 * DT])
    expected = np.diag([0.1**2, 0.05**2, 1.0])
    for _ in range(600):
        gain = expected @ seen.T @ np.linalg.inv(seen @ expected @ seen.T + noise)
        expected = step @ (expected - gain @ seen @ expected) @ step.T + wander
    np.testing.assert_allclose(RADAR.gain, gain, atol=1e-6)
    twice = RadarFilter.steady(range_sd=0.2, speed_sd=0.1, wander=0.2)
    np.testing.assert_allclose(twice.gain, RADAR.gain, atol=1e-9)


def test_noise_is_taken_out():
    gap, leader, likely_gap, likely_leader = drive(np.zeros(4000), (0.1, 0.05))
    assert (likely_gap - gap)[100:].std() < 0.3 * 0.1
    assert (likely_leader - leader)[100:].std() < 0.5 * 0.05


@pytest.mark.parametrize(("braking", "off"), [(0.5, 0.11), (2.0, 0.42), (8.0, 0.5)])
def test_a_leader_that_brakes_is_known_at_once(braking, off):
    pull = np.zeros(100)
    pull[50:70] = -braking
    gap, leader, likely_gap, likely_leader = drive(pull, (0.0, 0.0))
    assert np.abs(likely_leader - leader).max() < off
    assert np.abs(likely_gap - gap).max() < 0.25


def test_another_vehicle_is_believed_at_once_and_after_nothing_seen_it_begins_anew():
    cut_in = -15.0 * (np.arange(60) >= 30)
    gap, _, likely_gap, _ = drive(np.zeros(60), (0.0, 0.0), cut_in)
    np.testing.assert_allclose(likely_gap, gap, atol=1e-9)
    lost, track = RADAR(np.array([[np.nan, 18.0, np.nan, 36.0, 0.0]]), np.array([[40.0, 18.0, 0.0]]))
    assert np.isnan(lost[0, [0, 2]]).all()
    again, _ = RADAR(np.array([[18.5, 18.0, 41.0, 36.0, 0.0]]), track)
    np.testing.assert_array_equal(again[0], [18.5, 18.0, 41.0, 36.0, 0.0])


def test_the_shield_hears_the_reading_itself(toy):
    """The filter hardly moves for one reading beyond the limit; the shield must act on it there and then."""
    features = FeatureMap.default(power=True)
    layers = [(np.zeros((2, len(features.names))), np.zeros(2))]
    driver = guard(MlpPolicy(layers, features, ActionScale.of(toy), toy.interface))
    assert driver.shield is not None
    p = driver.shield.assumed
    speed, none = np.array([18.1]), np.zeros(1)
    needed = p.needed_gap(speed, np.array([17.9]), none, p.dt)[0] + p.gap_error + p.soft_m
    seen = {"leader_speed": 18.0, "speed": 18.0, "target_time_gap": 2.0}
    for _ in range(50):
        driver.act({**seen, "gap": needed + 0.3})
        assert not driver.acted.any()
    driver.act({**seen, "gap": needed - p.soft_m - 0.1})
    assert driver.acted.all()


def test_a_follower_keeps_its_pedals_quiet(toy):
    """The textbook start over a radar of 0.1 m and 0.05 m/s, with the filter and without."""
    batch = SeedBatch([0], FeatureMap.default(power=True), replace(ActionScale.of(toy), exclusive=True))
    batch.start_as_follower(PedalMap.calibrate(toy))
    policy = batch.policy(0, toy.interface, {})
    rng, scene = np.random.default_rng(3), scenes.paper(np.random.default_rng(5), 20, 400, DT)
    noise = {"seen_gap_offset": 0.1, "seen_speed_offset": 0.05}
    scene = replace(scene, **{name: sd * rng.normal(size=(20, 400)) for name, sd in noise.items()})

    def swing(driver: MlpPolicy) -> float:
        return float(roll_out(toy, driver, scene)["engine_command"][200:].std(axis=0).mean())

    bare = replace(policy, features=replace(policy.features, radar=None))
    assert swing(policy) < 0.35 * swing(bare)
