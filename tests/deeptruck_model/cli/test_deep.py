"""`deeptruck-model train`: what it replaces, and what it refuses to lose."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from deeptruck_model.deep import resume, training

Script = Callable[..., tuple[int, str, str]]


@pytest.fixture(scope="module")
def monday(bag: Callable[..., Path]) -> Path:
    return bag("monday", 120.0)


@pytest.fixture
def killed(monday: Path, script: Script, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The --out of a training that ended after its first checkpoint."""
    save = resume.save

    def last(*everything: object) -> None:
        save(*everything)  # type: ignore[arg-type]
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(training.resume, "save", last)
        code, _, _ = script("train", monday, "--out", tmp_path / "sim", "--budget", 40)
    assert code == 130 and (tmp_path / "sim.partial" / resume.FILE).exists()
    return tmp_path / "sim"


@pytest.mark.parametrize("more", [[], ["--overwrite"]])
def test_an_unfinished_training_is_not_discarded(
    script: Script, monday: Path, killed: Path, more: list[str]
) -> None:
    checkpoint = killed.with_name("sim.partial") / resume.FILE
    before = checkpoint.read_bytes()
    code, said, errors = script("train", monday, "--out", killed, "--budget", 40, *more)
    assert code == 2 and not said and errors.count("\n") == 1
    assert "sim.partial is an unfinished training; add --resume" in errors
    assert checkpoint.read_bytes() == before and not killed.exists()


def test_an_unfinished_training_goes_on(script: Script, monday: Path, killed: Path) -> None:
    code, said, _ = script("train", monday, "--out", killed, "--budget", 40, "--resume")
    assert code == 0 and "trained in" in said
    assert (killed / "simulator.json").exists() and not (killed / resume.FILE).exists()
    assert not killed.with_name("sim.partial").exists()


def test_a_finished_simulator_is_replaced_when_asked_only(
    script: Script, monday: Path, tmp_path: Path
) -> None:
    words = ("train", monday, "--out", tmp_path / "sim", "--budget", 4)
    assert script(*words)[0] == 0
    code, _, errors = script(*words)
    assert code == 2 and "exists already; choose another --out, or add --overwrite" in errors
    assert script(*words, "--overwrite")[0] == 0


def test_what_is_no_bag_or_no_folder_is_one_line(script: Script, monday: Path, tmp_path: Path) -> None:
    assert script("train", monday, "--out", tmp_path / "sim", "--budget", 4)[0] == 0
    code, _, errors = script("train", tmp_path / "sim", "--out", tmp_path / "other")
    assert code == 2 and "sim is a simulator directory, not a bag" in errors and "repair" not in errors
    (tmp_path / "file").write_text("x")
    code, _, errors = script("experiment", "classics", "--out", tmp_path / "file")
    assert code == 2 and errors.count("\n") == 1 and "cannot write" in errors
