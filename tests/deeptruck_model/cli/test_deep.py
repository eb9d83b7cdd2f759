"""`deeptruck-model train`: what it replaces, and what it refuses to lose."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from deeptruck_model import trucks
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
        code, *_ = script("train", monday, "--out", tmp_path / "sim", "--budget", 40)
    assert code == 130 and (tmp_path / ".sim.unfinished" / resume.FILE).exists()
    return tmp_path / "sim"


def test_before_the_first_checkpoint_nothing_is_left_to_go_on_from(
    script: Script, monday: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def first(*_: object) -> None:
        assert any((tmp_path / ".sim.unfinished").iterdir())  # curves, from which nothing goes on
        raise KeyboardInterrupt

    monkeypatch.setattr(training.resume, "save", first)
    code, _, errors = script("train", monday, "--out", tmp_path / "sim", "--budget", 40)
    assert code == 130 and errors
    assert not list(tmp_path.iterdir())


def test_an_unfinished_training_is_not_discarded_and_goes_on(
    script: Script, monday: Path, killed: Path
) -> None:
    checkpoint = killed.with_name(".sim.unfinished") / resume.FILE
    before = checkpoint.read_bytes()
    code, said, errors = script("train", monday, "--out", killed, "--budget", 40)
    assert code == 2 and not said and errors.count("\n") == 1
    assert "--resume" in errors and "--overwrite" in errors
    assert checkpoint.read_bytes() == before and not killed.exists()
    code, said, _ = script("train", monday, "--out", killed, "--budget", 40, "--resume")
    assert code == 0 and "trained in" in said
    assert (killed / "simulator.json").exists() and not (killed / resume.FILE).exists()
    assert [p.name for p in killed.parent.iterdir()] == ["sim"]


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ("train BAG none --out other", "none does not exist"),
        ("train BAG --out link", "link is a symbolic link"),
        ("export none --out BAG/metadata.yaml", "metadata.yaml exists already"),
        ("export truck:trucksim --out other.onnx", "truck:trucksim is no deep truck"),
    ],
)
def test_what_does_not_fit_is_one_line(
    script: Script, monday: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: str, says: str
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("link").symlink_to(tmp_path)
    code, _, errors = script(*words.replace("BAG", str(monday)).split())
    assert code == 2 and errors.count("\n") == 1 and says in errors
    assert not Path("other").exists()


def test_what_is_no_bag_is_one_line(script: Script, tmp_path: Path) -> None:
    trucks.load("trucksim").save(tmp_path / "sim")
    code, _, errors = script("train", tmp_path / "sim", "--out", tmp_path / "other")
    assert code == 2 and "sim is a simulator directory, not a bag" in errors and "repair" not in errors
