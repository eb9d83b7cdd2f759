import json
import re
from pathlib import Path

import pytest
from typer.testing import CliRunner

from deeptruck_model.cli import whole
from deeptruck_model.deep import DeepTruck, onnx_export
from deeptruck_model.recordings import write_bag


@pytest.mark.usefixtures("undrawn")
def test_commands_from_bag_to_figures(drive, tmp_path):
    app = whole()
    recording = drive(60)
    write_bag(tmp_path / "bag", [recording], interface=recording.interface)
    runner, bag, sim = CliRunner(), str(tmp_path / "bag"), str(tmp_path / "sim")
    trained = runner.invoke(app, ["train", bag, "--out", sim, "--seed", "3", "--budget", "20"])
    assert trained.exit_code == 0, trained.output
    again = runner.invoke(app, ["train", bag, "--out", sim, "--seed", "3", "--budget", "20", "--resume"])
    assert again.exit_code == 0, again.output
    more = ["--budget", "20", "--kind", "grey"]
    grey = runner.invoke(app, ["train", bag, "--out", str(tmp_path / "grey"), *more])
    assert grey.exit_code == 0, grey.output
    adapted = runner.invoke(
        app, ["train", bag, "--out", str(tmp_path / "b"), "--budget", "5", "--from", str(tmp_path / "grey")]
    )
    assert adapted.exit_code == 0, adapted.output
    assert json.loads((tmp_path / "b" / "simulator.json").read_text())["shape"]["gains"]
    calibrated = runner.invoke(app, ["calibrate", sim, bag, "--out", str(tmp_path / "calibrated")])
    assert calibrated.exit_code == 0, calibrated.output
    sim = str(tmp_path / "calibrated")
    assert runner.invoke(app, ["calibrate", sim, bag, "--out", sim]).exit_code != 0
    evaluated = runner.invoke(app, ["evaluate", sim, bag, "--out", str(tmp_path / "out"), "--trials", "5"])
    assert evaluated.exit_code == 0, evaluated.output
    metrics = json.loads((tmp_path / "out" / "metrics.json").read_text())
    assert metrics["trials"] == 5 and 0 < metrics["speed"]["inside_90"] <= 1
    assert "warning:" in evaluated.stderr
    unseen = drive(60, seed=9)
    write_bag(tmp_path / "unseen", [unseen], interface=unseen.interface)
    again = ["--out", str(tmp_path / "out"), "--overwrite"]
    other = runner.invoke(app, ["evaluate", sim, str(tmp_path / "unseen"), *again])
    assert other.exit_code == 0 and "warning:" not in other.stderr


# The snippets of docs/deep_model.md run as they stand, on a truck that was trained for a moment


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
