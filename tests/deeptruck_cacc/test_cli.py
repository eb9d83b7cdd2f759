from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from deeptruck_cacc import cli, load_policy
from deeptruck_cacc.evaluation import report
from deeptruck_core.terminal import progress

SIM = "truck:trucksim"


@pytest.fixture(autouse=True, scope="module")
def little_work(quick_exams) -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        short = {name: (draw, min(seconds, 30.0)) for name, (draw, seconds) in report.HARD.items()}
        patch.setattr(report, "HARD", short)
        patch.setattr(progress, "QUIET_S", 1e5)  # no progress, which a busy machine would show
        yield


def run(*arguments: object) -> int:
    with pytest.MonkeyPatch.context() as patch, pytest.raises(SystemExit) as ended:
        patch.setattr(sys, "argv", ["deeptruck-cacc", *map(str, arguments)])
        cli.main()
    return ended.value.code or 0


def last_line(capsys) -> str:
    return capsys.readouterr().err.strip().splitlines()[-1]


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["train", "--simulator", "nowhere", "--out", "{tmp}/p"], ["nowhere does not exist"]),
        (["train", "--simulator", SIM, "--out", "{tmp}/taken"], ["taken holds thesis.tex but no"]),
        (["train", "--simulator", SIM, "--out", "{tmp}/link"], ["link is a symbolic link"]),
        (
            ["train", "--simulator", SIM, "--trainer=trpo", "--scene=moon", "--out={tmp}/p"],
            ["no scene 'moon'"],
        ),
        (["train", "--simulator", SIM, "--out={tmp}/p", "--window=2"], ["'--window'"]),
        (["train", "--simulator", SIM, "--out={tmp}/p", "--gamma=0.9"], ["no setting of --trainer analytic"]),
        (["evaluate", "{tmp}/p", "--simulator", SIM, "--out", "{tmp}/e"], ["it has no policy.json"]),
        (["evaluate", "baseline:x", "--simulator", SIM, "--out", "{tmp}/e"], ["known: acc"]),
        (["evaluate", "planner:x?economy", "--simulator", SIM, "--out", "{tmp}/e"], ["use planner:x"]),
        (["evaluate", "mine.onnx", "--simulator", SIM, "--out", "{tmp}/e"], ["use the policy directory"]),
        (["export", "baseline:acc", "--out", "{tmp}/p.onnx"], ["not a trained policy"]),
        (["export", "{tmp}/p", "--out={tmp}/taken/thesis.tex"], ["exists already"]),
    ],
)  # fmt: skip
def test_bad_input_is_one_line_with_every_misfit_and_exit_code_2(capsys, tmp_path, arguments, says):
    (tmp_path / "taken").mkdir()
    (tmp_path / "taken" / "thesis.tex").write_text("x")
    (tmp_path / "link").symlink_to(tmp_path / "taken")
    code = run(*(a.format(tmp=tmp_path) for a in arguments))
    err = capsys.readouterr().err
    assert code == 2 and len(err.strip().splitlines()) == 1
    assert all(words in err for words in says), err
    assert sorted(p.name for p in Path(tmp_path).iterdir()) == ["link", "taken"]


@pytest.mark.usefixtures("undrawn")
def test_train_and_evaluate_on_a_physics_truck(capsys, tmp_path):
    out = str(tmp_path / "p")
    arguments = ["--trainer", "trpo", "--simulator", SIM, "--out", out]
    arguments += ["--iterations", "2", "--environments", "5", "--path", "80"]
    assert run("train", *arguments) == 0
    assert load_policy(out).card["simulator"] == SIM
    assert (tmp_path / "p" / "seeds" / "0" / "learning_curve.jsonl").exists()  # the trainer of many seeds
    assert run("train", *arguments) == 2  # a policy that is there is not replaced unasked
    assert "p holds a policy already; choose another --out, or add --overwrite" in last_line(capsys)
    evaluation = ["--simulator", SIM, "--out", tmp_path / "e", "--rollouts", "2", "--shield"]
    assert run("evaluate", out, *evaluation) == 0
    assert {"metrics.json", "evaluation.html", "learning_curve.png"} <= {
        p.name for p in (tmp_path / "e").iterdir()
    }
    assert run("evaluate", out, *evaluation) == 2
    assert "e holds an evaluation of a policy already" in last_line(capsys)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["e", "p"]
