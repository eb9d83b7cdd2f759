from __future__ import annotations

import shutil
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from deeptruck_cacc import cli, load_policy
from deeptruck_cacc.training import analytic


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


@pytest.fixture
def small(monkeypatch, tmp_path) -> list[str]:
    """Arguments of a training that takes no time."""
    settle = analytic.settled
    monkeypatch.setattr(analytic, "settled", lambda config: settle(replace(config, rollouts=2, window=40)))
    train = ["train", "--simulator", "truck:trucksim", "--out", str(tmp_path / "p")]
    return [*train, "--seeds", "1", "--iterations", "2"]


def test_resuming_a_finished_run_says_so_at_once(monkeypatch, capsys, small):
    assert run(monkeypatch, *small) == 0
    monkeypatch.setattr("deeptruck_model.simulators.load", None)  # nothing is even loaded
    capsys.readouterr()
    assert run(monkeypatch, *small, "--resume") == 0
    assert "finished before, with this simulator and these arguments" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("changed", "says"),
    [
        (["--seeds", "2"], "(seeds was 1, given 2)"),
        (["--seed", "7", "--scene", "paper"], "(seed was 0, given 7; scene was wide, given paper)"),
        (["--simulator", "truck:volvo"], "(simulator was truck:trucksim, given truck:volvo)"),
        (["--trainer", "trpo"], "(trainer was analytic, given trpo)"),
    ],
)
@pytest.mark.parametrize("checkpoint", [True, False])
def test_resuming_another_run_names_what_differs(
    monkeypatch, capsys, tmp_path, small, changed, says, checkpoint
):
    run(monkeypatch, *small)
    if not checkpoint:
        shutil.rmtree(tmp_path / "p" / "checkpoint")
    before = (tmp_path / "p" / "policy.json").read_bytes()
    capsys.readouterr()
    assert run(monkeypatch, *small, *changed, "--resume") == 2
    (line,) = capsys.readouterr().err.splitlines()  # no empty one before it
    assert says in line and "--overwrite in place of --resume" in line
    assert (tmp_path / "p" / "policy.json").read_bytes() == before


def test_resuming_where_nothing_is_says_that_it_begins(monkeypatch, capsys, tmp_path, small):
    assert run(monkeypatch, *small, "--resume") == 0
    assert "p holds nothing to go on from; training from the beginning" in capsys.readouterr().err
    assert (tmp_path / "p" / "policy.json").exists()


def test_a_damaged_checkpoint_is_named_with_advice_that_is_taken(monkeypatch, capsys, tmp_path, small):
    run(monkeypatch, *small)
    (tmp_path / "p" / "policy.json").unlink()
    checkpoint = tmp_path / "p" / "checkpoint" / "state.safetensors"
    checkpoint.write_bytes(checkpoint.read_bytes()[:100])
    capsys.readouterr()
    assert run(monkeypatch, *small, "--resume") == 2
    assert "state.safetensors is damaged" in capsys.readouterr().err
    assert run(monkeypatch, *small, "--overwrite") == 0


def test_a_run_that_was_to_replace_a_policy_goes_on_after_a_kill(monkeypatch, capsys, tmp_path, small):
    run(monkeypatch, *small)
    checkpoint = tmp_path / "p" / "checkpoint"
    first = shutil.copytree(tmp_path / "p", tmp_path / "first")
    run(monkeypatch, *small, "--seed", "3", "--overwrite")
    for name in ("policy.json", "policy.safetensors"):  # as if killed before the end
        shutil.copy(first / name, tmp_path / "p" / name)
    assert checkpoint.exists()
    assert run(monkeypatch, *small, "--seed", "3", "--resume") == 0
    assert load_policy(tmp_path / "p").card["seed"] == 3


def test_a_killed_training_is_not_begun_anew_unasked(monkeypatch, capsys, tmp_path, small):
    run(monkeypatch, *small)
    (tmp_path / "p" / "policy.json").unlink()  # as if killed before the end
    capsys.readouterr()
    assert run(monkeypatch, *small) == 2
    assert "is an unfinished training; add --resume to go on with it" in capsys.readouterr().err
    assert run(monkeypatch, *small, "--resume") == 0


def test_an_export_replaces_nothing_but_an_onnx_file(monkeypatch, capsys, tmp_path, small):
    run(monkeypatch, *small)
    thesis, onnx = tmp_path / "thesis.tex", tmp_path / "p.onnx"
    thesis.write_text("x")
    assert run(monkeypatch, "export", str(tmp_path / "p"), "--out", str(thesis)) == 2
    assert "thesis.tex exists and is no .onnx file" in capsys.readouterr().err and thesis.read_text() == "x"
    for _ in range(2):
        assert run(monkeypatch, "export", str(tmp_path / "p"), "--out", str(onnx)) == 0
