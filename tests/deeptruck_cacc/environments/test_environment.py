from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from stable_baselines3.common.env_checker import check_env as check_sb3

from deeptruck_cacc import CaccEnv, Reward
from deeptruck_cacc.controllers.scaling import ActionScale, FeatureMap, paper_signals
from deeptruck_cacc.environments import hard_scenes, scenes
from deeptruck_cacc.environments.adapters import CaccGymEnv, CaccSb3VecEnv
from deeptruck_cacc.environments.shielded import ShieldedEnv
from deeptruck_cacc.training.saving import simulator_sha256
from deeptruck_core.errors import InputError


def test_kinematics_are_the_papers_equations(toy):
    env = CaccEnv(toy, batch=4, steps=20, draw=scenes.moving, seed=1)
    env.reset()
    p_leader, v_leader = np.array(env.gap), np.array(env.leader_speed)
    p_ego, v_ego = np.zeros(4), np.array(env.speed)
    state = toy.reset(np.column_stack([np.zeros(4), v_ego, np.zeros(4)]))
    commands = np.tile([900.0, 0.0], (4, 1))
    for k in range(20):
        _, _, info = env.step(commands)
        state, y = toy.step(state, commands, env.scene.grade[:, k : k + 1])
        p_leader, p_ego = p_leader + v_leader * 0.1, p_ego + v_ego * 0.1
        v_leader, v_ego = v_leader + env.scene.leader_acceleration[:, k] * 0.1, y[:, 1]
        np.testing.assert_allclose(info["gap"], p_leader - p_ego, atol=1e-9)
        np.testing.assert_allclose(info["speed_error"], v_leader - v_ego, atol=1e-12)
    assert env.done


def test_initial_distributions_are_the_papers(toy):
    scene = scenes.paper(np.random.default_rng(0), 20000, 5, 0.1)
    assert 8.3 <= scene.leader_speed.min() < 8.4
    assert 22.1 < scene.leader_speed.max() <= 22.2
    for error in (scene.speed - scene.leader_speed, scene.gap - scene.speed * scene.time_gap):
        assert -1.39 - 1e-9 <= error.min() < -1.38
        assert 1.38 < error.max() <= 1.39 + 1e-9
    assert scene.time_gap.min() >= 2.0 and scene.time_gap.max() <= 5.0
    assert not scene.leader_acceleration.any()


def test_reward_matches_the_printed_form_and_charges_a_crash():
    plain = Reward.paper()
    r = plain(np.array([50.0, 1.0]), np.array([2.0, 2.0]), np.array([0.5, 0.5]), 0.5, 0.0)
    expected = -(0.2 * 4 + 0.5 * 0.25 + 0.01 * 0.25)
    np.testing.assert_allclose(r / plain.scale, [expected, expected - 100.0])


def test_observation_map_is_invertible_and_actions_round_trip(toy):
    features = FeatureMap.default(memory=False)
    signals = np.array([[20.0, 19.0, 41.0, 40.0, 0.02]])
    x, _ = features(signals, features.start(1))
    back = np.linalg.solve(features.matrix, (x - features.offset).T).T
    np.testing.assert_allclose(back, signals)
    scale = ActionScale.of(toy)
    commands = np.array([[700.0, 0.0], [0.0, 35.0]])
    np.testing.assert_allclose(scale.commands(scale.actions(commands)), commands)


def test_exclusive_pedals_never_act_together_and_leave_the_rest(toy):
    scale = replace(ActionScale.of(toy), exclusive=True)
    commands = np.array([[700.0, 0.0], [0.0, 35.0]])
    np.testing.assert_allclose(scale.commands(scale.actions(commands)), commands)
    both = scale.commands(np.array([[0.2, 0.1], [-0.8, 0.5], [0.0, 0.5]]))
    np.testing.assert_allclose(both, [[1000.0, 0.0], [0.0, 40.0], [0.0, 0.0]], atol=1e-9)


def said(features, ideal, wanted):
    """Checks what `features` say 0.2 m/s slower than the leader, 1 m too far, at 3 s, uphill; the memory."""
    x, memory = features(np.array([[17.2, 17.0, 52.0, 51.0, 0.01]]), features.start(1))
    slope = 9.81 * 0.01
    powers = [(wanted + slope) * 17 / 8, slope * 17 / 8]
    expected = [*ideal, np.tanh(1 / 17 / 0.3), 2 * wanted, *powers, 0.0, 0.0]
    np.testing.assert_allclose(x[0, 8:], expected, atol=1e-9)
    return memory


def test_gymnasium_face_passes_check_env_and_is_registered(toy):
    check_env(gymnasium.make("deeptruck/Cacc-v0", simulator=toy, steps=30).unwrapped, skip_render_check=True)
    check_sb3(CaccGymEnv(toy, steps=30))


def test_seeds_reproduce(toy):
    def run(seed: int) -> np.ndarray:
        env = CaccGymEnv(toy, steps=30)
        seen = [env.reset(seed=seed)[0]]
        seen += [env.step(np.array([0.2, -1.0], np.float32))[0] for _ in range(30)]
        seen.append(env.reset()[0])
        return np.array(seen)

    np.testing.assert_array_equal(run(3), run(3))
    assert not np.array_equal(run(3), run(4))


def test_the_batch_of_stable_baselines_is_that_of_the_environment(toy):
    env, bare, features = CaccSb3VecEnv(toy, 3, steps=6), CaccEnv(toy, 3, 6), FeatureMap.default(memory=False)

    def shown(observation) -> np.ndarray:
        return features(paper_signals(observation), features.start(3))[0]

    env.seed(7)
    observation, whole = bare.reset(seed=7), np.zeros(3)
    np.testing.assert_allclose(env.reset(), shown(observation), rtol=1e-5)
    for k in range(6):
        env.step_async(np.zeros((3, 2), np.float32))
        _, reward, done, infos = env.step_wait()
        observation, paid, _ = bare.step(bare.scale.commands(np.zeros((3, 2))))
        np.testing.assert_allclose(reward, paid, rtol=1e-6)
        whole += paid
        assert done.all() == (k == 5)
    np.testing.assert_allclose(infos[1]["terminal_observation"], shown(observation)[1], rtol=1e-5)
    np.testing.assert_allclose([one["episode"]["r"] for one in infos], whole)


def test_radar_faults_are_seen_and_not_felt(toy):
    scene = scenes.paper(np.random.default_rng(0), 2, 10, 0.1)
    seen, offset = np.ones((2, 10), bool), np.zeros((2, 10))
    seen[0, 3], offset[1, 3] = False, 30.0
    clean, faulty = CaccEnv(toy), CaccEnv(toy)
    clean.reset(scene)
    faulty.reset(scenes.replace(scene, seen=seen, seen_gap_offset=offset))
    commands = np.tile([300.0, 0.0], (2, 1))
    for _ in range(3):
        expected, *_ = clean.step(commands)
        got, *_ = faulty.step(commands)
    assert np.isnan(got["gap"][0]) and got["gap"][1] == pytest.approx(expected["gap"][1] + 30.0)
    np.testing.assert_array_equal(clean.gap, faulty.gap)


def test_another_vehicle_takes_the_leaders_place_at_its_own_gap_and_speed(toy):
    scene = scenes.paper(np.random.default_rng(0), 2, 10, 0.1)
    further, faster = np.zeros((2, 10)), np.zeros((2, 10))
    further[:, 3], faster[:, 3] = (-12.0, 15.0), (1.0, -100.0)
    same, other = CaccEnv(toy), CaccEnv(toy)
    same.reset(scene)
    other.reset(scenes.replace(scene, gap_jump=further, leader_speed_jump=faster))
    for _ in range(3):
        for env in (same, other):
            env.step(np.tile([300.0, 0.0], (2, 1)))
    np.testing.assert_allclose(other.gap, same.gap + np.array([-12.0, 15.0]))
    np.testing.assert_allclose(other.leader_speed, [same.leader_speed[0] + 1.0, 0.0])


def test_late_commands_reach_each_truck_its_own_steps_later(toy):
    scene = scenes.replace(scenes.paper(np.random.default_rng(0), 3, 12, 0.1), speed=np.full(3, 15.0))
    scene = scenes.replace(scene, command_delay=np.array([0, 1, 2]))
    env = CaccEnv(toy)
    env.reset(scene)
    speeds = []
    for k in range(6):
        env.step(np.full((3, 2), (200.0, 0.0) if k < 3 else (1500.0, 0.0)))
        speeds.append(env.speed)
    at_once, one, two = np.array(speeds).T
    assert at_once[0] == one[0] == two[0]  # the first command is there from the start
    assert at_once[3] > one[3] == two[3] and one[4] > two[4]


# Hard scenes are what their descriptions say, row by row


DT = 0.1


def test_a_jump_of_the_radar_is_20_to_40_m_and_up_to_3_m_s_for_1_to_3_s_from_20_s_on() -> None:
    scene = hard_scenes.radar_jump(np.random.default_rng(0), 100, 600, DT)
    assert scene.seen_gap_offset is not None and scene.seen_speed_offset is not None
    further, faster = scene.seen_gap_offset, scene.seen_speed_offset
    np.testing.assert_array_equal(further != 0.0, faster != 0.0)
    during = (further != 0.0).sum(axis=1)
    assert 10 <= during.min() <= during.max() <= 30
    for row, steps in enumerate(during):
        assert not further[row, :200].any() and (further[row, 200 : 200 + steps] == further[row, 200]).all()
    assert 20.0 <= further[:, 200].min() <= further[:, 200].max() <= 40.0
    assert 0.0 <= faster[:, 200].min() <= faster[:, 200].max() <= 3.0


# The environment drives an outside simulator by its name, and a training knows it by its content


def test_the_environment_drives_it(shuttle: Path) -> None:
    env = CaccGymEnv(f"python:{shuttle.stem}:make")
    env.reset(seed=0)
    for _ in range(3):
        observation, reward, *_ = env.step(np.array([0.5, -1.0], np.float32))
    assert np.isfinite(observation).all() and np.isfinite(reward)


def test_a_changed_module_is_another_simulator(shuttle: Path) -> None:
    text = f"python:{shuttle.stem}:make"
    before = simulator_sha256(text)
    assert simulator_sha256(text) == before
    shuttle.write_text(shuttle.read_text() + "\n# a remark\n")
    assert simulator_sha256(text) != before


# gymnasium finds the environment once the package is imported


def test_importing_the_package_registers_without_loading_the_environment() -> None:
    script = (
        "import sys, gymnasium, deeptruck_cacc\n"
        "print('torch' in sys.modules, gymnasium.spec('deeptruck/Cacc-v0').entry_point)\n"
    )
    said = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True).stdout
    assert said.split() == ["False", "deeptruck_cacc.environments.adapters:CaccGymEnv"]


def test_power_features_say_what_following_takes():
    features = FeatureMap.default(power=True)
    behind = 0.2 + 0.4 / 3.0  # the leader's speed suits 51.6 m, so the ideal follower is above it by 0.4 / 3
    lasting = 0.1 * 0.5 / 3.0 / 6.0  # 0.1 s of 1 m, of which half counts, at 3 s
    wanted = 0.2 / 3.0 + (behind + lasting) / 0.8
    memory = said(features, [2 * 0.2 / 3.0, behind, 0.0], wanted)
    memory = features.remember(memory, np.array([[0.5, -3.0]]))
    np.testing.assert_allclose(memory[0, 4:6], [0.1, -0.2])
    plain = FeatureMap.default()
    np.testing.assert_array_equal(plain.remember(memory[:, :3], np.ones((1, 2))), memory[:, :3])


def test_where_commands_come_late_the_ideal_follower_is_the_remembered_one():
    closing = 2.0 + 0.1 * 3.0  # it has 17.2 m/s and 51.6 m
    memory = said(FeatureMap.default(power=True, late=True), [0.0, 0.2, 0.2], (0.4 + 0.4 / closing) / closing)
    assert memory[0, 3] == 17.2


# The same environment behind the shield


FULL_THROTTLE = np.array([1.0, -1.0], np.float32)


def drive(env: gymnasium.Env, seed: int) -> list[dict]:
    env.reset(seed=seed)
    infos, truncated = [], False
    while not truncated:
        *_, truncated, info = env.step(FULL_THROTTLE)
        infos.append(info)
    return infos


@pytest.mark.parametrize("seed", range(2))
def test_full_throttle_crashes_without_it_and_never_with_it(seed):
    bare = CaccGymEnv("truck:trucksim", steps=500)
    assert any(info["crash"] for info in drive(bare, seed))
    infos = drive(ShieldedEnv(bare), seed)
    assert not any(info["crash"] for info in infos)
    assert any(info["shield_acted"] for info in infos)


def test_the_three_commands_say_what_was_changed_and_where():
    env = ShieldedEnv(CaccGymEnv("truck:trucksim", steps=300))
    scale = env.unwrapped.cacc.scale
    infos = drive(env, 0)
    for info in infos:
        assert tuple(info["u_nom"]) == (scale.engine_high, 0.0)
        assert info["shield_acted"] == (not np.array_equal(info["u_nom"], info["u_safe"]))
        np.testing.assert_allclose(info["u_applied"], info["u_safe"], rtol=1e-12, atol=1e-9)
        if info["shield_braking"]:
            assert tuple(info["u_safe"]) == (scale.engine_low, scale.brake_high)
    assert {info["shield_acted"] for info in infos} == {True, False}


def test_what_reaches_the_truck_has_the_gain_and_delay_of_the_scene():
    env = ShieldedEnv(CaccGymEnv("truck:trucksim", steps=100, scene="late"))
    env.reset(seed=4)
    cacc = env.unwrapped.cacc
    (delay,), (gain,) = cacc.scene.command_delay, cacc.scene.command_gain
    sent = [env.step(np.array([-1 + k / 50, -1.0]))[-1] for k in range(100)]
    late = [info["u_applied"] for info in sent[delay:]]
    np.testing.assert_allclose(late, [gain * info["u_safe"] for info in sent[: 100 - delay]], atol=1e-9)


@pytest.mark.filterwarnings("ignore:.*is different from the unwrapped version")
def test_it_is_a_gymnasium_environment_that_repeats_itself():
    check_env(ShieldedEnv(CaccGymEnv("truck:trucksim", steps=30)), skip_render_check=True)
    env = ShieldedEnv(CaccGymEnv("truck:trucksim", steps=60))
    first, again = drive(env, 3), drive(env, 3)
    assert [tuple(i["u_safe"]) for i in first] == [tuple(i["u_safe"]) for i in again]


def test_another_environment_is_refused():
    with pytest.raises(InputError, match="CartPoleEnv is not deeptruck/Cacc-v0"):
        ShieldedEnv(gymnasium.make("CartPole-v1"))
