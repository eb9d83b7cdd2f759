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
from deeptruck_cacc.environments.reward import Reward
from deeptruck_cacc.environments.rollouts import roll_out
from deeptruck_cacc.training import AnalyticConfig, TrpoConfig, train, validation
from deeptruck_cacc.training.network import SeedBatch
from deeptruck_cacc.training.road import Road
from deeptruck_core.errors import InputError
from deeptruck_model.deep.card import git_hash

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


def test_outside_a_checkout_the_commit_is_unknown(tmp_path, monkeypatch):
    monkeypatch.setenv("GIT_DIR", str(tmp_path))
    assert git_hash() is None


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


@pytest.mark.usefixtures("quick_exam")
def test_where_commands_come_late_errors_are_wanted_gone_more_slowly(toy, tmp_path):
    few = replace(QUICK, iterations=1)
    at_once, late = (train(toy, tmp_path / scene, replace(few, scene=scene)) for scene in ("wide", "late"))
    assert load_policy(tmp_path / "late").features.closing_s == late.features.closing_s
    assert late.features.approach == 0.0 < at_once.features.approach
    assert late.features.closing_s > at_once.features.closing_s


@pytest.mark.usefixtures("quick_exam")
def test_random_weights_learn_at_their_own_rate_unless_told(toy, tmp_path):
    def rate(out: str, **settings) -> float:
        config = replace(QUICK, iterations=1, **settings)
        return train(toy, tmp_path / out, config).card["config"]["learning_rate"]

    assert rate("a", memory=False) == 6e-3
    assert rate("b") == 3e-4
    assert rate("c", learning_rate=2e-3) == 2e-3


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


def test_asking_for_both_pedals_costs_although_only_one_acts(toy):
    scene = scenes.moving(np.random.default_rng(5), 4, 30, toy.dt)
    batch = SeedBatch([0], FeatureMap.default(power=True), replace(ActionScale.of(toy), exclusive=True))
    with torch.no_grad():
        for weight in batch.weights:
            weight.zero_()
        batch.biases[-1][:, :, 0], batch.biases[-1][:, :, 1] = (
            -0.4,
            0.1,
        )  # 0.3 of the engine, 0.1 of the brake

    def cost(alpha: float) -> torch.Tensor:
        road = Road(toy, Reward(), alpha_asked=alpha)
        return road.drive(scene, batch, road.start(scene, batch), 30)[1].cost.mean()

    assert (cost(200.0) - cost(0.0)).item() == pytest.approx(200.0 * 0.3 * 0.1, rel=1e-4)
    (cost(200.0) - cost(0.0)).backward()
    engine, brake = batch.biases[-1].grad[0, 0]
    assert engine > 0 and brake > 0  # a step down the gradient takes both back


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


def test_trpo_leaves_nothing_outside_its_folder(toy, tmp_path, monkeypatch):
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(elsewhere))
    train(toy, tmp_path / "policy", replace(QUICK_TRPO, iterations=2))
    lock = f"deeptruck-{os.getuid()}"  # of the name `policy`
    assert [place.name for place in elsewhere.iterdir()] == [lock]


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
