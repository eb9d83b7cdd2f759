from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import onnx
import onnxruntime
import pytest
from safetensors.numpy import save_file

from deeptruck_cacc import CaccEnv, MlpPolicy, Policy, cli, load_policy
from deeptruck_cacc.controllers.baselines import LAWS, baseline
from deeptruck_cacc.controllers.law import Seen
from deeptruck_cacc.controllers.pedals import PedalMap
from deeptruck_cacc.controllers.policy import MANIFEST, WEIGHTS
from deeptruck_cacc.controllers.scaling import OBSERVED, ActionScale, FeatureMap
from deeptruck_cacc.environments import scenes
from deeptruck_cacc.safety.guard import load_controller
from deeptruck_core.errors import InputError
from deeptruck_core.signals import TruckInterface

SEEN = {"leader_speed": 20.0, "speed": 19.0, "gap": 40.0, "target_time_gap": 2.0, "grade": 0.01}


def random_policy(memory: bool = True, power: bool = False) -> MlpPolicy:
    rng = np.random.default_rng(0)
    features = FeatureMap.default(memory=memory, power=power)
    sizes = [len(features.names), 25, 25, 25, 2]
    layers = [(rng.normal(0, 0.4, (b, a)), rng.normal(0, 0.1, b)) for a, b in pairwise(sizes)]
    truck = TruckInterface("toy")
    scale = replace(ActionScale.of(truck), exclusive=power)
    return MlpPolicy(layers, features, scale, truck, {"speed": (7.0, 24.0)}, {"seed": 0})


@pytest.mark.parametrize(("memory", "power"), [(True, True), (True, False), (False, False)])
def test_a_saved_policy_acts_the_same(tmp_path, memory, power):
    policy = random_policy(memory, power)
    policy.save(tmp_path / "p")
    loaded = load_policy(tmp_path / "p")
    assert isinstance(loaded, Policy)
    for gap in (40.0, 39.0, 37.0):
        np.testing.assert_array_equal(policy.act({**SEEN, "gap": gap}), loaded.act({**SEEN, "gap": gap}))
    assert loaded.coverage == policy.coverage and loaded.card == policy.card


@pytest.mark.parametrize(
    ("law", "wanted"),
    [
        ("acc", 0.23 * 6.0 + 0.07 * -2.0),
        ("cacc", 0.45 * 6.0 + 0.25 * -2.0 + 0.3),
        ("idm", 1.0 - (20.0 / 40.0) ** 4 - ((24.0 + 20.0 * 2.0 / (2 * (1.0 * 1.5) ** 0.5)) / 30.0) ** 2),
        ("pi", 0.12 * 6.0 + 0.5 * -2.0 + 0.02 * 5.0 + 0.7 * 0.3),
    ],
)
def test_a_law_is_its_printed_formula(law: str, wanted: float) -> None:
    """At 20 m/s, 30 m behind a leader of 18 m/s and 0.3 m/s^2, where 24 m are wanted."""
    numbers = (18.0, 20.0, 30.0, 24.0, 0.3, 0.0, 5.0)
    assert LAWS[law](Seen(*(np.array([x]) for x in numbers))) == pytest.approx(wanted)


def test_a_policy_of_before_there_was_a_gap_that_suits_remembers_its_ideal_follower(tmp_path):
    features = FeatureMap.default(power=True, late=True)
    replace(random_policy(power=True), features=features).save(tmp_path / "p")
    manifest = json.loads((tmp_path / "p" / "policy.json").read_text())
    del manifest["features"]["approach"], manifest["features"]["integral_rate"]
    (tmp_path / "p" / "policy.json").write_text(json.dumps(manifest))
    assert load_policy(tmp_path / "p").features.to_dict() == features.to_dict()


def test_reset_forgets_and_rows_do_not_mix():
    policy = random_policy()
    first = policy.act(SEEN)
    assert not np.array_equal(policy.act({**SEEN, "gap": 42.0}), first)
    policy.reset()
    np.testing.assert_array_equal(policy.act(SEEN), first)
    policy.reset()
    both = policy.act({**SEEN, "gap": np.array([40.0, 70.0])})
    np.testing.assert_allclose(both[0][0], first[0][0])


def test_commands_stay_within_reach_and_nan_stays_nan():
    policy = random_policy()
    for gap in (-1e6, 0.0, 1e6):
        engine, brake = policy.act({**SEEN, "gap": gap})
        assert 0 <= engine[0] <= 2000 and 0 <= brake[0] <= 100
    assert np.isnan(policy.act({**SEEN, "gap": np.nan})[0][0])


def test_the_node_needs_no_training_stack(tmp_path):
    random_policy().save(tmp_path / "p")
    code = (
        "import sys; from deeptruck_cacc import load_policy; "
        f"p = load_policy({str(tmp_path / 'p')!r}); p.act({SEEN!r}); "
        f"load_policy('baseline:acc').act({SEEN!r}); "
        "bad = {'torch', 'gymnasium', 'stable_baselines3', 'pickle5'} & set(sys.modules); assert not bad, bad"
    )
    subprocess.run([sys.executable, "-c", code], check=True, timeout=240)


def without(*keys: str) -> Callable[[Path], None]:
    """Damage: the manifest without one of its entries."""

    def damage(path: Path) -> None:
        manifest = json.loads((path / MANIFEST).read_text())
        part = manifest
        for key in keys[:-1]:
            part = part[key]
        del part[keys[-1]]
        (path / MANIFEST).write_text(json.dumps(manifest))

    return damage


def changed(part: str, name: str, value: object) -> Callable[[Path], None]:
    """Damage: another value in the manifest."""

    def damage(path: Path) -> None:
        manifest = json.loads((path / MANIFEST).read_text())
        manifest[part][name] = value
        (path / MANIFEST).write_text(json.dumps(manifest))

    return damage


def halved(name: str) -> Callable[[Path], None]:
    """Damage: half of a file."""
    return lambda path: os.truncate(path / name, (path / name).stat().st_size // 2)


@pytest.mark.parametrize(
    ("damage", "says"),
    [
        (lambda p: (p / MANIFEST).unlink(), "has no policy.json"),
        (halved(MANIFEST), "p/policy.json is damaged"),
        (without("features", "matrix"), "p/policy.json lacks 'features.matrix'"),
        (changed("features", "dt", 0.0), "p/policy.json has an impossible features.dt: it is damaged"),
        (changed("action", "brake_high", -100.0), "p/policy.json has an impossible action"),
        (changed("coverage", "speed", [float("nan"), 24.0]), "p/policy.json has an impossible coverage"),
        (halved(WEIGHTS), "p/policy.safetensors is damaged"),
        (lambda p: (p / WEIGHTS).unlink(), "p/policy.safetensors is missing"),
        (lambda p: save_file({"0.weight": np.eye(2)}, p / WEIGHTS), "safetensors lacks '0.bias'"),
    ],
)
def test_a_damaged_directory_is_one_clear_line(tmp_path, damage, says):
    random_policy(power=True).save(tmp_path / "p")
    damage(tmp_path / "p")
    with pytest.raises(InputError) as error:
        load_policy(tmp_path / "p")
    line = str(error.value)
    assert says in line and "\n" not in line and line.count("train") == 1


def test_an_observation_without_a_signal_says_which(tmp_path):
    random_policy().save(tmp_path / "p")
    with pytest.raises(InputError, match="observation lacks gap; a policy needs leader_speed"):
        load_controller(tmp_path / "p").act({"leader_speed": 20.0, "speed": 20.0, "target_time_gap": 2.0})


def test_a_policy_for_another_truck_is_refused(tmp_path):
    random_policy().save(tmp_path / "p")
    assert json.loads((tmp_path / "p" / MANIFEST).read_text())["action"]["units"]["engine_command"] == "N m"
    with pytest.raises(InputError, match="percent"):
        load_policy(tmp_path / "p", TruckInterface("volvo", "percent", "m/s^2"))


@pytest.mark.parametrize("name", sorted(LAWS))
def test_baselines_follow_a_steady_leader(toy, name):
    env = CaccEnv(toy, batch=20, seed=2, draw=scenes.graded)
    policy = baseline(name, toy.interface, PedalMap.calibrate(toy))
    seen = env.reset()
    while not env.done:
        seen, _, info = env.step(np.column_stack(policy.act(seen)))
    assert np.abs(info["speed_error"]).max() < 0.15
    if name != "idm":
        assert np.abs(info["time_gap_error"]).max() < 0.1


def test_calibrated_pedals_give_the_wanted_acceleration(toy):
    pedals = PedalMap.calibrate(toy)
    wanted = np.array([0.5, 0.0, -2.0])
    engine, brake = pedals.commands(wanted, np.full(3, 15.0), np.array([0.02, -0.02, 0.0]))
    got = engine / 1000 - 0.06 * brake - 0.05 - 9.81 * np.array([0.02, -0.02, 0.0])
    np.testing.assert_allclose(got, wanted, atol=0.05)


# A policy as ONNX


onnxruntime.set_default_logger_severity(3)


@pytest.mark.parametrize(
    ("memory", "power", "late"),
    [
        (True, True, False),
        *(pytest.param(*one, marks=pytest.mark.long) for one in ((False, False, False), (True, True, True))),
    ],
)
def test_an_exported_policy_drives_like_itself_and_says_what_its_numbers_mean(
    tmp_path, monkeypatch, memory, power, late
):
    rng = np.random.default_rng(1)
    features = FeatureMap.default(memory=memory, power=power, late=late)
    sizes = [len(features.names), 25, 25, 25, 2]
    layers = [(rng.normal(0, 0.4, (b, a)), rng.normal(0, 0.3, b)) for a, b in pairwise(sizes)]
    truck = TruckInterface("volvo", "percent", "m/s^2")
    scale = ActionScale(10.0, 90.0, 6.0, exclusive=power)
    policy = MlpPolicy(layers, features, scale, truck, {}, {"seed": 3})
    policy.save(tmp_path / "policy")
    monkeypatch.setattr(
        sys, "argv", ["deeptruck-cacc", "export", str(tmp_path / "policy"), "--out", str(tmp_path / "p.onnx")]
    )
    with pytest.raises(SystemExit) as ended:
        cli.main()
    assert not ended.value.code
    (facts,) = (json.loads(p.value) for p in onnx.load(tmp_path / "p.onnx").metadata_props)
    assert facts["units"] == {"engine_command": "percent", "brake_command": "m/s^2"}
    assert facts["dt"] == 0.1 and facts["card"] == {"seed": 3}
    session = onnxruntime.InferenceSession(tmp_path / "p.onnx")
    state = {"memory": features.start(50).astype(np.float32)} if memory else {}
    for k in range(20):
        if k % 5 == 0:  # another leader
            speed, gap = rng.uniform(5, 25, 50), rng.uniform(10, 90, 50)
            near = [rng.uniform(1, 5, 50), rng.uniform(-0.05, 0.05, 50)]
        leader = speed + rng.normal(0, 0.05, 50)
        values = [leader, speed + rng.normal(0, 0.2, 50), gap + rng.normal(0, 0.1, 50), *near]
        seen = dict(zip(OBSERVED, values, strict=True))
        got = session.run(None, {n: x[:, None].astype(np.float32) for n, x in seen.items()} | state)
        state = {"memory": got[2]} if memory else {}
        engine, brake = policy.act(seen)
        np.testing.assert_allclose(got[0][:, 0], engine, atol=0.02)
        np.testing.assert_allclose(got[1][:, 0], brake, atol=0.002)
