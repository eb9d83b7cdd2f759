import json
from dataclasses import replace

import numpy as np
import onnxruntime
import pytest
from typer.testing import CliRunner

from deeptruck_core.errors import InputError
from deeptruck_core.signals import TruckInterface
from deeptruck_model.cli import whole
from deeptruck_model.deep import onnx_export, train


def run(session, truck, u, w, y0):
    members, hidden = truck.network.shape.members, truck.network.shape.hidden
    h = c = np.zeros((members, len(y0), hidden), np.float32)
    y = np.repeat(y0[None], members, axis=0).astype(np.float32)
    responses = []
    for k in range(u.shape[1]):
        feed = {"h": h, "c": c, "y": y, "u": u[:, k].astype(np.float32), "w": w[:, k].astype(np.float32)}
        h, c, y, response = session.run(None, feed)
        responses.append(response)
    return np.stack(responses, axis=1)


@pytest.mark.parametrize(("fuel", "kind"), [(True, "black"), (False, "grey")])
def test_parity_with_the_truck(truck, drive, small, tmp_path, fuel, kind):
    if kind == "grey":
        interface = TruckInterface("own", fuel=fuel, **({} if fuel else {"brake_unit": None, "grade": False}))
        truck = train([drive(120, interface=interface)], tmp_path / "sim", replace(small, kind=kind))
    recording = drive(120, seed=3, interface=truck.interface)
    starts = [0, 300, 700]
    u, w, y = (np.stack([a[s : s + 300] for s in starts]) for a in (recording.u, recording.w, recording.y))
    u[2, :, 0] = 0.0  # comes to rest
    onnx_export.export(truck, tmp_path / "truck.onnx")
    session = onnxruntime.InferenceSession(tmp_path / "truck.onnx")
    expected = truck.rollout(u, w, y[:, 0], None).y[:, 1:]
    np.testing.assert_allclose(run(session, truck, u, w, y[:, 0])[:, :-1], expected, atol=2e-3)
    metadata = session.get_modelmeta().custom_metadata_map
    assert json.loads(metadata["interface"])["name"] == truck.interface.name
    assert float(metadata["dt"]) == truck.dt


def test_the_command_exports_deep_trucks_only(truck, tmp_path):
    app = whole()
    truck.save(tmp_path / "sim")
    runner, out = CliRunner(), str(tmp_path / "truck.onnx")
    done = runner.invoke(app, ["export", str(tmp_path / "sim"), "--out", out])
    assert done.exit_code == 0, done.output
    assert onnxruntime.InferenceSession(out).get_inputs()[0].name == "h"
    refused = runner.invoke(app, ["export", "truck:volvo", "--out", str(tmp_path / "other.onnx")])
    assert isinstance(refused.exception, InputError) and "no deep truck" in str(refused.exception)
