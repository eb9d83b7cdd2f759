from __future__ import annotations

import shutil
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

from deeptruck_cacc import MlpPolicy, cli, load_policy
from deeptruck_cacc.evaluation import report
from deeptruck_cacc.training import settings

SIM = "truck:trucksim"


@dataclass(frozen=True)
class Small(settings.AnalyticConfig):
    """A training that takes no time."""

    rollouts: int = 2
    window: int = 40


@dataclass(frozen=True)
class SmallTrpo(settings.TrpoConfig):
    environments: int = 5
    path: int = 80


@pytest.fixture(autouse=True, scope="module")
def little_work(quick_exams) -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        short = {name: (draw, min(seconds, 30.0)) for name, (draw, seconds) in report.HARD.items()}
        patch.setattr(report, "HARD", short)
        patch.setattr(settings, "AnalyticConfig", Small)
        patch.setattr(settings, "TrpoConfig", SmallTrpo)
        yield


def run(*arguments: object) -> int:
    with pytest.MonkeyPatch.context() as patch, pytest.raises(SystemExit) as ended:
        patch.setattr(sys, "argv", ["deeptruck-cacc", *map(str, arguments)])
        cli.main()
    return ended.value.code or 0


def training(folder: Path) -> list[str]:
    return ["train", "--simulator", SIM, "--out", f"{folder}/p", "--seeds", "1", "--iterations", "2"]


def kill(*arguments: str) -> None:
    """Run a training and interrupt it before its policy is written."""

    def killed(policy: MlpPolicy, draft: Path) -> None:
        raise KeyboardInterrupt

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(MlpPolicy, "write_into", killed)
        assert run(*arguments) == 130


def content(folder: Path) -> dict[str, bytes]:
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


@pytest.fixture(scope="module")
def trained_once(little_work, tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("trained")
    assert run(*training(folder)) == 0
    return folder


@pytest.fixture(scope="module")
def killed_once(little_work, tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("killed")
    kill(*training(folder))
    return folder


@pytest.fixture
def finished(trained_once, tmp_path) -> Path:
    """A folder with a policy `p`."""
    shutil.copytree(trained_once, tmp_path, dirs_exist_ok=True)
    return tmp_path


@pytest.fixture
def unfinished(killed_once, tmp_path) -> Path:
    """A folder in which the training of `p` was killed."""
    shutil.copytree(killed_once, tmp_path, dirs_exist_ok=True)
    return tmp_path


def last_line(capsys) -> str:
    return capsys.readouterr().err.strip().splitlines()[-1]


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["train", "--simulator", "nowhere", "--out", "{tmp}/p"], ["nowhere does not exist"]),
        (["train", "--simulator", "truck:nosuch", "--out", "{tmp}/p"], ["nosuch"]),
        (["train", "--simulator", SIM, "--out", "{tmp}/taken"], ["taken holds thesis.tex but no"]),
        (["train", "--simulator", SIM, "--out", "{tmp}/link"], ["link is a symbolic link"]),
        (
            ["train", "--simulator", "nowhere", "--trainer=trpo", "--scene=moon", "--out", "{tmp}/taken"],
            ["no scene 'moon'", "nowhere does not exist", "thesis.tex"],
        ),
        (["evaluate", "{tmp}/p", "--simulator", SIM, "--out", "{tmp}/e"], ["it has no policy.json"]),
        (["evaluate", "baseline:x", "--simulator", SIM, "--out", "{tmp}/e"], ["known: acc"]),
        (["evaluate", "baseline:acc", "--simulator", "nowhere", "--out={tmp}/e"], ["nowhere does not exist"]),
        (["evaluate", "baseline:acc", "--simulator", SIM, "--out={tmp}/taken"], ["taken holds thesis.tex"]),
        (["export", "baseline:acc", "--out", "{tmp}/p.onnx"], ["not a trained policy"]),
        (["export", "{tmp}/p", "--out={tmp}/taken/thesis.tex"], ["it has no policy.json", "exists already"]),
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
def test_train_evaluate_export_on_a_physics_truck(capsys, tmp_path):
    out = str(tmp_path / "p")
    arguments = ["--trainer", "trpo", "--iterations", "2", "--simulator", SIM, "--out", out]
    assert run("train", "--printed-reward", *arguments[2:]) == 2
    assert "--printed-reward is the paper's, for --trainer trpo" in last_line(capsys)
    assert run("train", *arguments) == 0
    assert load_policy(out).card["simulator"] == SIM
    assert (tmp_path / "p" / "seeds" / "0" / "learning_curve.jsonl").exists()  # the trainer of many seeds
    assert run("train", *arguments) == 2  # a policy that is there is not replaced unasked
    assert "p holds a policy already; choose another --out, or add --overwrite" in last_line(capsys)
    assert run("train", *arguments, "--overwrite") == 0
    assert run("export", out, "--out", tmp_path / "p.onnx") == 0
    assert (tmp_path / "p.onnx").exists()
    evaluation = ["--simulator", SIM, "--out", tmp_path / "e", "--rollouts", "3", "--shield"]
    assert run("evaluate", out, *evaluation) == 0
    assert {"metrics.json", "evaluation.html", "learning_curve.png"} <= {
        p.name for p in (tmp_path / "e").iterdir()
    }
    assert run("evaluate", out, *evaluation) == 2
    assert "e holds an evaluation of a policy already" in last_line(capsys)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["e", "p", "p.onnx"]


def test_resuming_a_finished_run_says_so_at_once(monkeypatch, capsys, finished):
    monkeypatch.setattr("deeptruck_model.simulators.load", None)  # nothing is even loaded
    assert run(*training(finished), "--resume") == 0
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
@pytest.mark.parametrize("state", ["finished", "unfinished"])
def test_resuming_another_run_names_what_differs(capsys, request, state, changed, says):
    folder = request.getfixturevalue(state)
    before = content(folder)
    capsys.readouterr()
    assert run(*training(folder), *changed, "--resume") == 2
    (line,) = capsys.readouterr().err.splitlines()  # no empty one before it
    assert says in line and "--overwrite in place of --resume" in line
    assert content(folder) == before


def test_resuming_where_nothing_is_says_that_it_begins(capsys, trained_once, tmp_path):
    assert run(*training(tmp_path), "--resume") == 0
    assert "p holds nothing to go on from; training from the beginning" in capsys.readouterr().err
    weights = "policy.safetensors"
    assert content(tmp_path / "p")[weights] == content(trained_once / "p")[weights]


def test_a_killed_training_goes_on_only_where_asked_and_ends_as_an_undisturbed_one(
    capsys, trained_once, unfinished
):
    assert [p.name for p in unfinished.iterdir()] == [".p.unfinished"]  # no policy by halves
    before = content(unfinished)
    assert run(*training(unfinished)) == 2
    assert "add --resume to go on with it, or --overwrite to begin anew" in last_line(capsys)
    assert content(unfinished) == before
    assert run(*training(unfinished), "--resume") == 0
    assert [p.name for p in unfinished.iterdir()] == ["p"]
    for name in ("policy.safetensors", "learning_curve.jsonl", "seeds/0/policy.safetensors"):
        assert content(unfinished / "p")[name] == content(trained_once / "p")[name]


def test_a_damaged_checkpoint_is_named_with_advice_that_is_taken(capsys, unfinished):
    checkpoint = unfinished / ".p.unfinished" / "checkpoint" / "state.safetensors"
    checkpoint.write_bytes(checkpoint.read_bytes()[:100])
    assert run(*training(unfinished), "--resume") == 2
    assert "state.safetensors is damaged" in last_line(capsys)
    assert run(*training(unfinished), "--overwrite") == 0
    (kept,) = (p for p in unfinished.iterdir() if p.name != "p")
    assert f"had begun is kept as {kept}; remove it" in capsys.readouterr().err
    assert (kept / "checkpoint" / "state.safetensors").exists()


def test_a_run_that_was_killed_before_its_first_checkpoint_is_set_aside_and_named(capsys, tmp_path):
    begun = tmp_path / ".p.unfinished" / "learning_curve.jsonl"
    begun.parent.mkdir()
    begun.write_text("mine")
    assert run(*training(tmp_path), "--resume") == 0
    (kept,) = (p for p in tmp_path.iterdir() if p.name != "p")
    assert f"had begun is kept as {kept}; remove it" in capsys.readouterr().err
    assert (kept / "learning_curve.jsonl").read_text() == "mine"
