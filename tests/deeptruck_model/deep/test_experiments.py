import json

import numpy as np
import pytest
from typer.testing import CliRunner

from deeptruck_model.cli import app, deep
from deeptruck_model.deep import experiments
from deeptruck_model.recordings import write_bag


def test_field_experiment_writes_tables_and_figures(tmp_path):
    metrics = experiments.field(tmp_path, seeds=1, updates=20)
    assert metrics["volvo"]["trials"] == 10 and metrics["freightliner"]["horizon_s"] == pytest.approx(15.0)
    assert (tmp_path / "volvo" / "error_statistics.png").stat().st_size > 10_000
    assert "freightliner, 16 min" in (tmp_path / "README.md").read_text()
    assert json.loads((tmp_path / "metrics.json").read_text())["volvo"]["trials"] == 10


def test_learning_curves_hold_every_seed(tmp_path, monkeypatch):
    drive = experiments._drive
    monkeypatch.setattr(experiments, "_drive", lambda name, minutes, seed: drive(name, minutes / 20, seed))
    curves = experiments.learning_curves(tmp_path, seeds=2, updates=40)
    assert np.shape(curves["training"]) == np.shape(curves["deployment"]) == (40, 2)
    assert np.isfinite(curves["deployment"]).all()
    assert (tmp_path / "learning_curves.png").exists()


def test_singles_are_the_members(truck, drive):
    recording = drive(30)
    u, w, y0 = recording.u[None], recording.w[None], recording.y[:1]
    runs = [single.rollout(u, w, y0, None).y for single in experiments.singles(truck)]
    np.testing.assert_allclose(np.mean(runs, axis=0), truck.rollout(u, w, y0, None).y, atol=1e-9)


def test_commands_from_bag_to_figures(drive, tmp_path):
    deep.register(app)
    recording = drive(60)
    write_bag(tmp_path / "bag", [recording], interface=recording.interface)
    runner, bag, sim = CliRunner(), str(tmp_path / "bag"), str(tmp_path / "sim")
    trained = runner.invoke(app, ["train", bag, "--out", sim, "--seed", "3", "--budget", "20"])
    assert trained.exit_code == 0, trained.output
    more = ["--budget", "20", "--kind", "grey"]
    grey = runner.invoke(app, ["train", bag, "--out", str(tmp_path / "grey"), *more])
    assert grey.exit_code == 0, grey.output
    adapted = runner.invoke(
        app, ["train", bag, "--out", str(tmp_path / "b"), "--budget", "5", "--from", str(tmp_path / "grey")]
    )
    assert adapted.exit_code == 0, adapted.output
    assert json.loads((tmp_path / "b" / "simulator.json").read_text())["shape"]["gains"]
    evaluated = runner.invoke(app, ["evaluate", sim, bag, "--out", str(tmp_path / "out"), "--trials", "5"])
    assert evaluated.exit_code == 0, evaluated.output
    assert json.loads((tmp_path / "out" / "metrics.json").read_text())["trials"] == 5
