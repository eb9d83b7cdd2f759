"""A policy that comes as ONNX drives as the one it was exported from, and a stranger's drives as well."""

from __future__ import annotations

import json
import re
from itertools import pairwise
from pathlib import Path

import numpy as np
import onnx
import pytest
from onnx import TensorProto, helper

from deeptruck_cacc import MlpPolicy, load_policy
from deeptruck_cacc.controllers.export import export_onnx
from deeptruck_cacc.controllers.scaling import OBSERVED, ActionScale, FeatureMap
from deeptruck_cacc.safety.guard import load_controller
from deeptruck_core.errors import InputError
from deeptruck_core.signals import TruckInterface
from deeptruck_model import trucks

DOCS = Path(__file__).parents[3] / "docs"
TRUCK = TruckInterface("volvo", "percent", "m/s^2")
COVERAGE = dict.fromkeys(OBSERVED, (-1000.0, 1000.0))


def trained(memory: bool = True) -> MlpPolicy:
    """A policy with random weights."""
    rng = np.random.default_rng(1)
    features = FeatureMap.default(memory=memory, power=memory)
    sizes = [len(features.names), 25, 25, 2]
    layers = [(rng.normal(0, 0.1, (b, a)), rng.normal(0, 0.1, b)) for a, b in pairwise(sizes)]
    return MlpPolicy(layers, features, ActionScale(10.0, 90.0, 6.0), TRUCK, COVERAGE)


def drive(k: int, batch: int = 4) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(k)
    speed = 20.0 + rng.normal(0, 0.2, batch)
    gap = 40.0 + rng.normal(0, 0.1, batch)
    return {"leader_speed": speed, "speed": speed, "gap": gap, "target_time_gap": np.full(batch, 2.0)}


def stranger(
    path: Path, facts: dict[str, object] | None, outputs: tuple[str, str] = ("engine", "brake")
) -> Path:
    """Somebody's own graph: the engine takes the gap, the brake the speed."""
    ports = [helper.make_tensor_value_info(n, TensorProto.FLOAT, ["batch", 1]) for n in OBSERVED]
    names = [f"{name}_command" for name in outputs]
    told = [helper.make_tensor_value_info(n, TensorProto.FLOAT, ["batch", 1]) for n in names]
    nodes = [helper.make_node("Relu", [x], [y]) for x, y in zip(("gap", "speed"), names, strict=True)]
    model = helper.make_model(
        helper.make_graph(nodes, "mine", ports, told),
        opset_imports=[helper.make_opsetid("", 17)],
        ir_version=9,
    )
    if facts is not None:
        helper.set_model_props(model, {"deeptruck": json.dumps(facts)})
    onnx.save(model, path)
    return path


@pytest.mark.parametrize("memory", [True, False])
def test_it_drives_as_the_policy_it_was_exported_from(tmp_path: Path, memory: bool) -> None:
    policy = trained(memory)
    policy.save(tmp_path / "policy")
    export_onnx(policy, tmp_path / "p.onnx")
    one, other = (load_controller(tmp_path / name, TRUCK) for name in ("policy", "p.onnx"))
    assert other.dt == one.dt and other.interface == one.interface and other.coverage == one.coverage
    for k in range(30):
        if k == 15:
            one.reset()
            other.reset()
        for a, b in zip(one.act(drive(k)), other.act(drive(k)), strict=True):
            np.testing.assert_allclose(b, a, atol=0.02)


def test_what_is_not_seen_commands_nothing_and_is_forgotten(tmp_path: Path) -> None:
    export_onnx(trained(), tmp_path / "p.onnx")
    policy, fresh = (load_policy(tmp_path / "p.onnx") for _ in range(2))
    for k in range(5):
        policy.act(drive(k))
    blind = drive(5) | {"gap": np.array([40.0, np.nan, 40.0, 40.0])}
    assert [list(np.isnan(x)) for x in policy.act(blind)] == [[False, True, False, False]] * 2
    after, first = policy.act(drive(6)), fresh.act(drive(6))
    assert after[0][1] == first[0][1] and after[0][0] != first[0][0]


def test_a_network_of_ones_own_needs_only_to_say_its_truck_and_period(tmp_path: Path) -> None:
    facts = {"dt": 0.1, "interface": TRUCK.to_dict()}
    policy = load_policy(stranger(tmp_path / "mine.onnx", facts), TRUCK)
    seen = {"leader_speed": 20.0, "speed": 1.5, "gap": 33.0, "target_time_gap": 2.0}
    assert np.concatenate(policy.act(seen)).tolist() == [33.0, 1.5]
    most = ActionScale.of(TRUCK)
    beyond = np.concatenate(policy.act(seen | {"speed": 500.0, "gap": 500.0})).tolist()
    assert beyond == [most.engine_high, most.brake_high]
    assert load_controller(tmp_path / "mine.onnx", TRUCK).dt == 0.1


def test_the_metadata_of_the_page_are_understood(tmp_path: Path) -> None:
    """The snippet of docs/nodes.md."""
    (block,) = re.findall(r"```python\n(.*?)```", (DOCS / "nodes.md").read_text(), re.DOTALL)
    model, truck = onnx.load(stranger(tmp_path / "mine.onnx", None)), trucks.load("trucksim")
    exec(block, {"onnx": onnx, "json": json, "model": model, "truck": truck})
    onnx.save(model, tmp_path / "mine.onnx")
    assert load_controller(tmp_path / "mine.onnx", truck.interface).coverage == {"speed": (0.0, 25.0)}


def test_what_is_no_policy_is_said_in_a_line(tmp_path: Path) -> None:
    (tmp_path / "text.onnx").write_text("no graph")
    stranger(tmp_path / "mute.onnx", None)
    stranger(tmp_path / "still.onnx", {"dt": 0.0, "interface": TRUCK.to_dict()})
    typo = {"dt": 0.1, "interface": TRUCK.to_dict(), "coverage": {"sped": [0.0, 1.0]}}
    stranger(tmp_path / "typo.onnx", typo)
    stranger(tmp_path / "other.onnx", {}, ("engine", "horn"))
    limp = {"engine_low": 0.0, "engine_high": 100.0, "brake_high": float("nan")}
    stranger(tmp_path / "limp.onnx", {"dt": 0.1, "interface": TRUCK.to_dict(), "action": limp})
    export_onnx(trained(), tmp_path / "p.onnx")
    for name, truck, says in (
        ("gone.onnx", None, "does not exist"),
        ("text.onnx", None, "is no ONNX that can be run"),
        ("mute.onnx", None, "metadata 'deeptruck' do not say .*no dt, interface"),
        ("still.onnx", None, "dt of 0.0 s"),
        ("typo.onnx", None, "coverage of sped; it may have leader_speed"),
        ("limp.onnx", None, "action or coverage is impossible"),
        ("other.onnx", None, "has no brake_command among its inputs and outputs"),
        ("p.onnx", TruckInterface("x", "N m", "percent"), "commands engine_command in percent"),
    ):
        with pytest.raises(InputError, match=says) as caught:
            load_policy(tmp_path / name, truck)
        assert "\n" not in str(caught.value)
