import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from benchmarks import paper
from benchmarks.paper import experiments
from benchmarks.paper.drives import drive_of
from benchmarks.paper.output import SHORT_RUNS, of_seeds
from benchmarks.paper.run import app
from deeptruck_model._terminal import console


def test_field_experiment_writes_tables_and_figures(tmp_path):
    metrics = experiments.field(tmp_path, seeds=2, updates=4)
    assert metrics["volvo"]["trials"] == 10 and metrics["freightliner"]["horizon_s"] == pytest.approx(15.0)
    assert (tmp_path / "volvo" / "error_statistics.png").stat().st_size > 10_000
    assert "freightliner, 16 min: worst of 2 seeds" in (tmp_path / "README.md").read_text()
    assert json.loads((tmp_path / "metrics.json").read_text())["volvo"]["trials"] == 10


@pytest.mark.usefixtures("undrawn")
def test_field_experiment_in_paper_mode_says_so(tmp_path):
    out = ["--out", str(tmp_path), "--seeds", "1", "--budget", "2"]
    done = CliRunner().invoke(app, ["field", "--mode", "paper", *out])
    assert done.exit_code == 0, done.output
    page = (tmp_path / "field" / "README.md").read_text()
    assert "mode paper: ten runs of 15 s" in page and "1 seed(s), 2 updates each, mode paper." in page


def test_a_file_in_the_way_of_an_experiment_is_one_line(tmp_path, capsys):
    (tmp_path / "file").write_text("x")
    with pytest.raises(SystemExit) as ended:
        console.run(app, "paper", ["classics", "--out", str(tmp_path / "file")])
    errors = capsys.readouterr().err
    assert ended.value.code == 2 and errors.count("\n") == 1 and "file is no folder" in errors


def test_the_script_runs_as_a_file():
    run = Path(paper.__file__).with_name("run.py")
    words = [sys.executable, run, "field", "--out", "none", "--mode", "moon"]
    done = subprocess.run(words, check=False, capture_output=True, text=True, cwd="/")
    assert done.returncode == 2 and "run.py: Invalid value for '--mode'" in done.stderr


def test_rows_of_seeds_take_each_figure_on_its_own():
    members = [
        {"speed": {"mean_abs": a, "mean_at_end": b, "largest": 1.0}, "acceleration": {"mean_abs": 0.1}}
        for a, b in ((0.1, -0.4), (0.2, 0.1), (0.3, 0.2))
    ]
    rows = dict(of_seeds(members, columns=SHORT_RUNS))
    assert rows["best of 3 seeds"]["speed"] == {"mean_abs": 0.1, "mean_at_end": 0.1, "largest": 1.0}
    assert rows["worst of 3 seeds"]["speed"] == {"mean_abs": 0.3, "mean_at_end": -0.4, "largest": 1.0}
    assert "fuel_rate" not in rows["median of 3 seeds"]


@pytest.mark.long
def test_minutes_of_data_are_drawn_for_every_truck(tmp_path, monkeypatch):
    monkeypatch.setattr(experiments, "TRUCKS", ("freightliner", "volvo"))
    monkeypatch.setattr(experiments, "MINUTES", (1, 2))
    monkeypatch.setattr(experiments, "FLEET", 2)
    monkeypatch.setattr(experiments, "FLEET_MINUTES", 2)
    monkeypatch.setattr(
        experiments, "drive_of", lambda name, length, seed: drive_of(name, min(length, 2), seed)
    )
    metrics = experiments.minutes_of_data(tmp_path, updates=5)
    assert list(metrics["volvo"]["adapted"]) == [0, 1, 2]
    assert list(metrics["volvo"]["from scratch"]) == [1, 2]
    assert "volvo: 2 min, adapted" in (tmp_path / "README.md").read_text()
    assert (tmp_path / "minutes.png").stat().st_size > 10_000


def test_singles_are_the_members(truck, drive):
    recording = drive(30)
    u, w, y0 = recording.u[None], recording.w[None], recording.y[:1]
    runs = [single.rollout(u, w, y0, None).y for single in experiments.singles(truck)]
    np.testing.assert_allclose(np.mean(runs, axis=0), truck.rollout(u, w, y0, None).y, atol=1e-9)
