from __future__ import annotations

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from deeptruck_cacc.environments.adapters import CaccGymEnv
from deeptruck_cacc.environments.shielded import ShieldedEnv
from deeptruck_core.errors import InputError

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
