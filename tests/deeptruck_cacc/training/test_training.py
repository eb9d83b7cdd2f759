from __future__ import annotations

import json
import os
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
import torch

from deeptruck_cacc import load_policy
from deeptruck_cacc.controllers.pedals import PedalMap
from deeptruck_cacc.controllers.scaling import ActionScale, FeatureMap
from deeptruck_cacc.environments import scenes
from deeptruck_cacc.environments.hard_scenes import cut_in
from deeptruck_cacc.environments.reward import Reward
from deeptruck_cacc.environments.rollouts import roll_out
from deeptruck_cacc.training import AnalyticConfig, TrpoConfig, train, validation
from deeptruck_cacc.training.lent_gradient import LentGradient, with_gradient
from deeptruck_cacc.training.network import SeedBatch
from deeptruck_cacc.training.road import Road
from deeptruck_core.errors import InputError
from deeptruck_core.signals import SPEED
from deeptruck_model import simulators

torch.set_num_threads(1)
QUICK = AnalyticConfig(seeds=2, rollouts=6, iterations=6, window=40, validate_every=3)
QUICK_TRPO = TrpoConfig(iterations=4, environments=5, path=80, validate_every=2)


def test_settings_out_of_range_are_named_together():
    with pytest.raises(InputError, match=r"seeds is 0; it must be at least 1; window is -5; .*'moon'"):
        AnalyticConfig(seeds=0, window=-5, scene="moon")
    with pytest.raises(InputError, match="curvature_share is nan; it must be 0 to 1"):
        TrpoConfig(curvature_share=float("nan"))


@pytest.mark.usefixtures("quick_exam")
@pytest.mark.parametrize("config", [replace(QUICK, iterations=2), replace(QUICK_TRPO, iterations=2)])
def test_the_same_seed_gives_the_same_policy(toy, tmp_path, config):
    first, second = (train(toy, tmp_path / name, config) for name in "ab")
    for (weight, bias), (same_weight, same_bias) in zip(first.layers, second.layers, strict=True):
        np.testing.assert_array_equal(weight, same_weight)
        np.testing.assert_array_equal(bias, same_bias)


@pytest.fixture(scope="module")
def trained(tmp_path_factory, request):
    toy = request.getfixturevalue("shared_toy")
    out = tmp_path_factory.mktemp("trained") / "policy"
    config = AnalyticConfig(seeds=2, rollouts=10, iterations=40, window=60, learning_rate=1e-3)
    return toy, out, train(toy, out, config)


ONE_THREAD = """
from deeptruck_cacc import training
from deeptruck_cacc.training import analytic
analytic.train = lambda *a, **k: print("threads", __import__("torch").get_num_threads()) or 1 / 0
try:
    training.train(None, "out")
except ZeroDivisionError:
    pass
"""


def test_a_training_has_one_thread_where_nothing_had_loaded_torch_before(tmp_path):
    """Of such small matrices a second one only waits, and computes many times as much while it does."""
    environment = os.environ | {"OMP_NUM_THREADS": "2"}
    start = [sys.executable, "-c", ONE_THREAD]
    told = subprocess.check_output(start, cwd=tmp_path, env=environment, text=True)
    assert told == "threads 1\n"


def test_identity_case_meets_the_papers_figures(trained):
    toy, out, _ = trained
    scene = scenes.paper(np.random.default_rng(99), 100, 400, toy.dt)
    trace = roll_out(toy, load_policy(out), scene)
    assert np.abs(trace["time_gap_error"][100:]).max() < 0.05
    assert np.abs(trace["speed_error"][250:]).max() < 0.03
    assert not trace["crash"].any()


def test_it_reaches_a_truck_that_is_heavier_and_slower(trained, make_toy):
    _, out, _ = trained
    truck = make_toy(lag=0.5, mass_factor=1.4)
    trace = roll_out(truck, load_policy(out), scenes.graded(np.random.default_rng(3), 100, 400, 0.1))
    assert np.abs(trace["time_gap_error"][100:]).max() < 0.08


def test_the_card_says_what_was_done(trained):
    _, out, policy = trained
    card = json.loads((out / "policy.json").read_text())["card"]
    assert card["trainer"] == "analytic" and card["config"]["iterations"] == 40
    assert card["validation"]["score"] == min(
        json.loads((out / "seeds" / s / "policy.json").read_text())["card"]["validation"]["score"]
        for s in "01"
    )
    assert set(policy.coverage) == {"leader_speed", "speed", "gap", "target_time_gap", "grade"}
    assert any((out / "tensorboard").iterdir())


@pytest.mark.usefixtures("quick_exam")
def test_the_best_of_all_validations_is_kept_and_the_last_iteration_is_validated(toy, tmp_path):
    out = tmp_path / "p"
    policy = train(toy, out, replace(QUICK, memory=False))
    curve = [json.loads(line) for line in (out / "learning_curve.jsonl").read_text().splitlines()]
    assert "validation" in curve[-1]
    best = np.min([line["validation"] for line in curve if "validation" in line], axis=0)
    assert policy.card["validation"]["score"] == best.min()


def test_a_start_that_follows_better_than_what_comes_of_it_is_kept(toy, tmp_path):
    config = replace(QUICK, seeds=1, iterations=2, learning_rate=1.0)
    train(toy, tmp_path / "p", config)
    curve = [json.loads(line) for line in (tmp_path / "p" / "learning_curve.jsonl").read_text().splitlines()]
    kept = json.loads((tmp_path / "p" / "policy.json").read_text())["card"]["validation"]["score"]
    assert kept < 0.5 * curve[-1]["validation"][0]


@pytest.mark.parametrize(("power", "drawn"), [(True, "wide"), (False, "wide"), (True, "late")])
def test_torch_and_numpy_agree_on_policy_and_road(toy, power, drawn):
    scene = scenes.DRAWERS[drawn](np.random.default_rng(5), 6, 60, toy.dt)
    scale = replace(ActionScale.of(toy), exclusive=power)
    batch = SeedBatch([0, 1], FeatureMap.default(power=power), scale)
    draw = torch.Generator().manual_seed(0)
    with torch.no_grad():
        for p in batch.parameters():
            p.add_(0.1 * torch.randn(p.shape, generator=draw))  # wilder ones magnify single precision
        road = Road(toy, Reward())
        state, first = road.drive(scene, batch, road.start(scene, batch), 30)
        _, second = road.drive(scene, batch, state, 30)
    speed_error = np.concatenate([first.speed_error, second.speed_error])
    for seed, rows in ((0, slice(0, 3)), (1, slice(3, 6))):
        policy = batch.policy(seed, toy.interface, {})
        trace = roll_out(toy, policy, scene)
        np.testing.assert_allclose(speed_error[:, rows], trace["speed_error"][:, rows], atol=2e-4)


def test_a_trained_policy_does_not_ask_for_both_pedals(trained):
    toy, out, _ = trained
    policy, asked = load_policy(out), []
    mean = policy.mean
    policy.mean = lambda seen: asked.append(mean(seen)) or asked[-1]
    roll_out(toy, policy, scenes.moving(np.random.default_rng(3), 20, 300, toy.dt))
    engine, brake = (np.array(asked)[..., 0] + 1) / 2, np.array(asked)[..., 1]
    assert ((engine > 0.03) & (brake > 0.03)).mean() < 0.001


@pytest.mark.usefixtures("quick_exam")
def test_a_run_that_fails_leaves_nothing(toy, tmp_path):
    with pytest.raises(ZeroDivisionError):
        train(toy, tmp_path / "p", QUICK, progress=lambda *_: 1 / 0)
    assert not list(tmp_path.iterdir())


def test_the_radar_of_a_scene_reaches_the_policy_in_training(toy):
    scene = scenes.moving(np.random.default_rng(5), 4, 30, toy.dt)
    batch = SeedBatch([0], FeatureMap.default(power=True), ActionScale.of(toy))
    batch.start_as_follower(PedalMap.calibrate(toy))
    road = Road(toy, Reward())

    def gaps(scene: scenes.Scene) -> torch.Tensor:
        with torch.no_grad():
            return road.drive(scene, batch, road.start(scene, batch), 30)[1].time_gap_error

    clear, far = gaps(scene), gaps(replace(scene, seen_gap_offset=np.full((4, 30), 5.0)))
    assert (far[-1] < clear[-1]).all()  # a leader that seems further is approached


def test_scores_count_only_what_the_task_allows():
    scene = validation.exam(0, 0.1)
    zero = np.zeros((400, scene.batch))
    speed = zero + 0.3
    got = validation.scores(scene, 0.1, zero, speed, np.zeros(scene.batch))
    np.testing.assert_allclose(got, np.repeat([0.3, 0.0, 0.3], [16, 16, 8]))
    crashed = np.arange(scene.batch) == 20
    after = validation.scores(scene, 0.1, zero, speed, crashed)
    np.testing.assert_allclose(after - got, 10.0 * crashed)
    gap = zero.copy()
    gap[round(validation.SETTLED_S / 0.1) - 1 :, 3] = np.linspace(9.0, 0.0, 301)
    late = validation.scores(scene, 0.1, gap, zero, np.zeros(scene.batch))
    np.testing.assert_allclose(late, np.where(np.arange(scene.batch) == 3, 9.0 - 0.03, 0.0))


# Every training starts as a follower of textbooks


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


# The gradient that is lent to a truck without one


torch.set_num_threads(1)


@pytest.fixture(scope="module")
def trucksim():
    return simulators.load("truck:trucksim")


def drive(module, u, w, speed=15.0):
    """Speeds (T,) with gradients, from commands u (T, rows, 2)."""
    y0 = torch.zeros(u.shape[1], 3)
    y0[:, SPEED] = speed
    state, speeds = module.reset(y0), []
    for k in range(len(u)):
        state, y = module(state, u[k], w[k])
        speeds.append(y[:, SPEED])
    return torch.stack(speeds)


def test_numbers_are_the_simulators(trucksim):
    rng = np.random.default_rng(0)
    u = np.stack([rng.uniform(0, 1500, (60, 4)), rng.uniform(0, 40, (60, 4))], axis=2)
    w = rng.uniform(-0.03, 0.03, (60, 4, 1))
    got = drive(with_gradient(trucksim).torch_module(), torch.tensor(u).float(), torch.tensor(w).float())
    y0 = np.tile([0.0, 15.0, 0.0], (4, 1))
    last = np.concatenate([u, u[-1:]]), np.concatenate([w, w[-1:]])
    true = simulators.free_run(trucksim, *(x.astype(np.float32).swapaxes(0, 1) for x in last), y0)
    np.testing.assert_allclose(got.numpy().T, true.y[:, 1:, SPEED], atol=1e-4)


def test_the_gradient_is_near_that_of_a_truck_that_has_one(toy):
    """The toy's own lag is 0.3 s, the lent one 0.4 s: after two seconds both have nearly arrived."""
    gradients = []
    for module in (toy.torch_module(), LentGradient(toy).torch_module()):
        u = torch.tensor([400.0, 0.0]).repeat(20, 3, 1).requires_grad_()
        drive(module, u, torch.zeros(20, 3, 1))[-1].sum().backward()
        gradients.append(u.grad.sum(dim=0)[0])
    own, lent = gradients
    np.testing.assert_allclose(lent[0], own[0], rtol=0.1)


def test_engine_drives_brake_holds_back_and_hills_do_too(trucksim):
    module = with_gradient(trucksim).torch_module()
    u = torch.tensor([700.0, 10.0]).repeat(10, 2, 1).requires_grad_()
    w = torch.zeros(10, 2, 1, requires_grad=True)
    drive(module, u, w)[-1].sum().backward()
    assert (u.grad[:, :, 0] > 0).all() and (u.grad[:, :, 1] < 0).all() and (w.grad < 0).all()


@pytest.mark.long
def test_training_on_a_physics_truck_gets_better_and_holds_the_gap(trucksim, tmp_path):
    scores = []
    for iterations in (1, 40):
        config = AnalyticConfig(seeds=1, rollouts=12, iterations=iterations, window=80)
        policy = train(trucksim, tmp_path / str(iterations), config)
        scores.append(policy.card["validation"]["score"])
    assert scores[1] < 0.85 * scores[0]
    trace = roll_out(trucksim, policy, scenes.paper(np.random.default_rng(1), 30, 400, trucksim.dt))
    assert np.abs(trace["time_gap_error"][250:]).max() < 0.2
    assert not trace["crash"].any()
