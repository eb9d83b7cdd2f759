"""Every training starts as a follower of textbooks, and its ideal costs nothing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import torch

from deeptruck_cacc.controllers.approach import approach
from deeptruck_cacc.controllers.pedals import PedalMap
from deeptruck_cacc.controllers.scaling import ActionScale, FeatureMap
from deeptruck_cacc.environments import scenes
from deeptruck_cacc.environments.hard_scenes import cut_in
from deeptruck_cacc.environments.reward import Reward
from deeptruck_cacc.environments.rollouts import roll_out
from deeptruck_cacc.training.network import SeedBatch
from deeptruck_cacc.training.road import Road

torch.set_num_threads(1)


def test_torch_and_numpy_agree_on_features():
    features = FeatureMap.default(power=True)
    batch = SeedBatch([0], features, ActionScale(0.0, 2000.0, 100.0))
    rng, memory = np.random.default_rng(0), features.start(6)
    same = torch.tensor(memory, dtype=torch.float32)
    for k in range(30):
        if k % 10 == 0:  # another leader
            first = rng.normal([15, 15, 45, 45, 0], [3, 3, 10, 10, 0.02], (6, 5))
            first[0] = [15, 0.5, 3, 3, 0]
        signals = first + 0.02 * rng.normal(size=first.shape)
        signals[:, 2] += 0.1 * (k % 10) * (first[:, 0] - first[:, 1])
        seen, memory = features(signals, memory)
        told, same = batch.observe(torch.tensor(signals, dtype=torch.float32), same)
        np.testing.assert_allclose(told, seen, atol=1e-4)
        np.testing.assert_allclose(same, memory, atol=1e-4)


def test_every_seed_starts_as_a_follower(toy):
    scene = scenes.moving(np.random.default_rng(5), 50, 400, toy.dt)
    scale = replace(ActionScale.of(toy), exclusive=True)
    batch = SeedBatch([0, 1], FeatureMap.default(power=True), scale)

    def worst(seed: int) -> float:
        trace = roll_out(toy, batch.policy(seed, toy.interface, {}), scene)
        return float(np.abs(trace["time_gap_error"][100:]).max())

    untaught = [worst(0), worst(1)]
    batch.start_as_follower(PedalMap.calibrate(toy))
    assert max(worst(0), worst(1)) < 0.6 < 0.3 * min(untaught)


def test_a_follower_has_the_leaders_speed_after_25_s_at_a_long_time_gap_too(toy):
    scene = replace(scenes.paper(np.random.default_rng(5), 50, 300, toy.dt), time_gap=np.full(50, 5.0))
    scene = replace(scene, gap=scene.speed * 5.0)
    batch = SeedBatch([0], FeatureMap.default(power=True), replace(ActionScale.of(toy), exclusive=True))
    batch.start_as_follower(PedalMap.calibrate(toy))
    trace = roll_out(toy, batch.policy(0, toy.interface, {}), scene)
    errors = np.abs(trace["speed_error"])
    assert errors[0].max() > 1.2
    assert errors[250:].max() < 0.03  # exp(-25/5) of 1.39 m/s is 0.009; the integral leaves the rest
    assert np.abs(trace["time_gap_error"][100:]).max() < 0.2


def test_a_follower_leaves_no_gap_error_that_lasts(toy):
    scene = replace(
        scenes.paper(np.random.default_rng(5), 50, 600, toy.dt), hidden_grade=np.full((50, 600), 0.01)
    )

    def left(integral_rate: float) -> float:
        features = replace(FeatureMap.default(power=True), integral_rate=integral_rate)
        batch = SeedBatch([0], features, replace(ActionScale.of(toy), exclusive=True))
        batch.start_as_follower(PedalMap.calibrate(toy))
        trace = roll_out(toy, batch.policy(0, toy.interface, {}), scene)
        return float(np.abs(trace["time_gap_error"][-50:]).max())

    assert left(1 / 6) < 0.005 < 0.02 < left(0.0)


def test_a_follower_gives_way_to_a_cut_in_without_nearly_stopping(toy):
    scene = cut_in(np.random.default_rng(5), 50, 600, toy.dt)
    batch = SeedBatch([0], FeatureMap.default(power=True), replace(ActionScale.of(toy), exclusive=True))
    batch.start_as_follower(PedalMap.calibrate(toy))
    trace = roll_out(toy, batch.policy(0, toy.interface, {}), scene)
    assert (trace["speed"] / trace["leader_speed"])[200:].min() > 0.55
    assert np.abs(trace["time_gap_error"][400:]).max() < 0.1


def test_the_ideal_follower_behind_a_moving_leader_costs_nothing(toy):
    scene = scenes.moving(np.random.default_rng(5), 8, 400, toy.dt)
    road = Road(toy, Reward())
    leader, ideal, *_, time_gap, _ = road._given(scene)
    gap = time_gap * ideal[0] + torch.cumsum((leader - ideal)[:-1], dim=0) * toy.dt
    ahead = ideal[1:]
    assert road._tracking(gap - time_gap * ahead, ahead, ahead).max() < 1e-3
    assert road._tracking(gap - time_gap * ahead + 0.1 * ahead, ahead, ahead).min() > 0.1


def test_at_the_right_time_gap_the_speed_that_suits_the_gap_is_the_trucks_own(toy):
    leader, *_, time_gap, _ = Road(toy, Reward())._given(
        scenes.moving(np.random.default_rng(5), 8, 400, toy.dt)
    )
    speed = leader + torch.sin(torch.arange(401.0) / 30)[:, None]
    above, _ = approach(time_gap * (speed - leader), time_gap, 1.0)
    torch.testing.assert_close(leader + above, speed)
