from __future__ import annotations

import json
import sys
from itertools import pairwise

import numpy as np
import onnx
import onnxruntime
import pytest

from deeptruck_cacc import MlpPolicy, cli
from deeptruck_cacc.controllers.scaling import OBSERVED, ActionScale, FeatureMap
from deeptruck_core.signals import TruckInterface

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
