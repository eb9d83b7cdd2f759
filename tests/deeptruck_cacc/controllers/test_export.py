from __future__ import annotations

import json
from itertools import pairwise

import numpy as np
import onnx
import onnxruntime
import pytest

from deeptruck_cacc import MlpPolicy
from deeptruck_cacc.controllers.export import export_onnx
from deeptruck_cacc.controllers.scaling import OBSERVED, ActionScale, FeatureMap
from deeptruck_core.errors import InputError
from deeptruck_core.signals import TruckInterface

onnxruntime.set_default_logger_severity(3)


@pytest.mark.parametrize(
    ("memory", "power", "late"),
    [
        (True, True, False),
        (False, False, False),
        pytest.param(True, True, True, marks=pytest.mark.long),
        pytest.param(True, False, False, marks=pytest.mark.long),
    ],
)
def test_onnx_drives_like_the_policy(tmp_path, memory, power, late):
    rng = np.random.default_rng(1)
    features = FeatureMap.default(memory=memory, power=power, late=late)
    sizes = [len(features.names), 25, 25, 25, 2]
    layers = [(rng.normal(0, 0.4, (b, a)), rng.normal(0, 0.3, b)) for a, b in pairwise(sizes)]
    truck = TruckInterface("volvo", "percent", "m/s^2")
    policy = MlpPolicy(layers, features, ActionScale(10.0, 90.0, 6.0, exclusive=power), truck)
    export_onnx(policy, tmp_path / "p.onnx")
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


def test_the_file_says_what_its_numbers_mean(tmp_path):
    features = FeatureMap.default(memory=False)
    policy = MlpPolicy(
        [(np.zeros((2, 5)), np.zeros(2))],
        features,
        ActionScale(0, 2000, 100),
        TruckInterface("toy"),
        {},
        {"seed": 3},
    )
    export_onnx(policy, tmp_path / "p.onnx")
    props = {p.key: p.value for p in onnx.load(tmp_path / "p.onnx").metadata_props}
    facts = json.loads(props["deeptruck"])
    assert facts["units"] == {"engine_command": "N m", "brake_command": "percent"}
    assert facts["dt"] == 0.1 and facts["card"] == {"seed": 3}
    assert [p.name for p in tmp_path.iterdir()] == ["p.onnx"]
    with pytest.raises(InputError, match=r"p\.onnx exists already"):
        export_onnx(policy, tmp_path / "p.onnx")
