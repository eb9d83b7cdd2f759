"""The snippets of docs/deep_model.md run as they stand, on a truck that was trained for a moment."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from deeptruck_model.deep import DeepTruck, onnx_export

PAGE = Path(__file__).parents[3] / "docs" / "deep_model.md"


def test_snippets_run(truck: DeepTruck, drive, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    truck.save(Path("simulators/mytruck"))
    onnx_export.export(truck, Path("mytruck.onnx"))
    recording = drive(10)
    use, onnx = re.findall(r"^```python\n(.*?)^```", PAGE.read_text(), re.S | re.M)
    names = {"u": recording.u[:1], "w": recording.w[:1], "y0": recording.y[:1]}
    step, _, predict = use.partition("prediction =")
    exec(compile(step, PAGE.name, "exec"), names)
    assert names["y"].shape == (1, 3)
    names |= {"u": recording.u[None], "w": recording.w[None]}
    exec(compile(f"prediction ={predict}", PAGE.name, "exec"), names)
    assert names["prediction"].covered.shape == (1, len(recording))
    exec(compile(onnx, PAGE.name, "exec"), names)
    assert names["response"].shape == (1, 3)
