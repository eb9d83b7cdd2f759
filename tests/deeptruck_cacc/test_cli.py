from __future__ import annotations

import sys
from pathlib import Path

import pytest

from deeptruck_cacc import cli, load_policy


def run(monkeypatch, *arguments: str) -> int:
    monkeypatch.setattr(sys, "argv", ["deeptruck-cacc", *arguments])
    with pytest.raises(SystemExit) as ended:
        cli.main()
    return ended.value.code or 0


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["train", "--simulator", "nowhere", "--out", "{tmp}/p"], "simulator"),
        (["train", "--simulator", "truck:nosuch", "--out", "{tmp}/p"], "nosuch"),
        (["train", "--simulator", "truck:trucksim", "--out", "{tmp}/taken"], "choose another --out"),
        (
            [
                "train",
                "--simulator",
                "truck:trucksim",
                "--trainer",
                "trpo",
                "--scene",
                "moon",
                "--out",
                "{tmp}/p",
            ],
            "moon",
        ),
        (["evaluate", "{tmp}/p", "--simulator", "truck:trucksim", "--out", "{tmp}/e"], "policy.json"),
        (["evaluate", "baseline:x", "--simulator", "truck:trucksim", "--out", "{tmp}/e"], "known: acc"),
        (["export", "baseline:acc", "--out", "{tmp}/p.onnx"], "not a trained policy"),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(monkeypatch, capsys, tmp_path, arguments, says):
    (tmp_path / "taken").mkdir()
    (tmp_path / "taken" / "thesis.tex").write_text("x")
    code = run(monkeypatch, *(a.format(tmp=tmp_path) for a in arguments))
    err = capsys.readouterr().err
    assert code == 2 and says in err.strip().splitlines()[-1]
    assert "Traceback" not in err
    assert sorted(p.name for p in Path(tmp_path).iterdir()) == ["taken"]


def test_train_evaluate_export_on_a_physics_truck(monkeypatch, tmp_path):
    sim, out = "truck:trucksim", str(tmp_path / "p")
    monkeypatch.setattr("deeptruck_cacc.training.trpo.TrpoConfig.path", 80)
    arguments = ["--trainer", "trpo", "--iterations", "2", "--simulator", sim, "--out", out]
    assert run(monkeypatch, "train", *arguments) == 0
    assert load_policy(out).card["simulator"] == sim
    assert run(monkeypatch, "train", *arguments) == 2  # a policy that is there is not replaced unasked
    assert run(monkeypatch, "train", *arguments, "--overwrite") == 0
    assert run(monkeypatch, "export", out, "--out", str(tmp_path / "p.onnx")) == 0
    assert (tmp_path / "p.onnx").exists()
    evaluation = ["--simulator", sim, "--out", str(tmp_path / "e"), "--rollouts", "5", "--shield"]
    assert run(monkeypatch, "evaluate", out, *evaluation) == 0
    assert (tmp_path / "e" / "metrics.json").exists()
