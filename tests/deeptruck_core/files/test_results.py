"""Results are whole or not there, one run at a time, and what another command or the user wrote stays."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest
from result_kit import KIND, OTHER, publish, record

from deeptruck_core import files
from deeptruck_core.errors import InputError
from deeptruck_core.files import lock

HOLD = """
import sys, pathlib
from deeptruck_core import files
with files.writing(pathlib.Path(sys.argv[1])):
    print("held", flush=True)
    sys.stdin.read()
"""


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_a_block_that_fails_leaves_the_older_result_and_nothing_else(tmp_path: Path) -> None:
    publish(tmp_path / "out", a="old")
    for out, overwrite in ((tmp_path / "out", True), (tmp_path / "never", False)):
        with pytest.raises(ZeroDivisionError), KIND.replacing(out, overwrite=overwrite) as draft:
            (draft / "a").write_text("new")
            raise ZeroDivisionError
    assert names(tmp_path) == ["out"] and (tmp_path / "out" / "a").read_text() == "old"


def test_an_older_result_is_replaced_whole_and_only_where_the_user_says_so(tmp_path: Path) -> None:
    publish(tmp_path / "out", a="old", gone="old")
    with pytest.raises(InputError, match="--overwrite"):
        publish(tmp_path / "out", a="new")
    publish(tmp_path / "out" / ".." / "out", overwrite=True, a="new")  # a path through the result itself
    assert names(tmp_path / "out") == [files.MARKER, "a"] and names(tmp_path) == ["out"]
    assert (tmp_path / "out" / "a").read_text() == "new"


@pytest.mark.parametrize(
    ("name", "word"),
    [
        ("file", "is a file"), ("file/below", "is no folder"), ("link", "symbolic link"),
        ("other", "another result"), ("mine", "notes.txt"), ("damaged", f"no {files.MARKER}"),
        ("done/sub", "would lie in"), ("taken", "no unfinished work"), ("begun", "--resume"),
        ("..", "no new folder's name"),
    ],
)  # fmt: skip
def test_where_a_result_may_not_be_written_is_refused_and_nothing_changes(
    tmp_path: Path, name: str, word: str
) -> None:
    (tmp_path / "file").write_text("x")
    (tmp_path / "link").symlink_to(tmp_path / "mine")
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "notes.txt").write_text("mine")
    with OTHER.replacing(tmp_path / "other"):
        pass
    for result in ("done", "damaged"):
        publish(tmp_path / result, a="old")
    (tmp_path / "damaged" / files.MARKER).write_text("[")
    (tmp_path / ".taken.unfinished").write_text("mine")
    with pytest.raises(ZeroDivisionError), KIND.replacing(tmp_path / "begun") as draft:
        (draft / "resume").touch()
        raise ZeroDivisionError
    before = sorted(tmp_path.rglob("*"))
    with pytest.raises(InputError, match=word):
        KIND.check(tmp_path / name, overwrite=name not in ("begun",))
    assert sorted(tmp_path.rglob("*")) == before


@pytest.mark.parametrize("older", [True, False])
def test_what_is_finished_is_kept_where_something_else_came_to_its_place(tmp_path: Path, older: bool) -> None:
    out = tmp_path / "out"
    if older:
        publish(out, a="old")
    for kept in (tmp_path / "out.new", tmp_path / "out.new1"):
        with (
            pytest.raises(InputError, match=f"kept as {kept}$"),
            KIND.replacing(out, overwrite=True) as draft,
        ):
            (draft / "a").write_text("new")
            if older:
                out.rename(tmp_path / "moved")
            out.mkdir()
            (out / "mine.txt").write_text("mine")
        assert (kept / "a").read_text() == "new" and KIND.marked(kept) and names(out) == ["mine.txt"]
        (out / "mine.txt").unlink()
        out.rmdir()
        if older:
            (tmp_path / "moved").rename(out)
    assert names(tmp_path) == [*(["out"] if older else []), "out.new", "out.new1"]


def test_unfinished_work_is_gone_on_with_or_begun_anew(tmp_path: Path) -> None:
    out, seen = tmp_path / "out", []
    for resume in (False, True, False):
        with pytest.raises(ZeroDivisionError), KIND.replacing(out, overwrite=True, resume=resume) as draft:
            seen.append(names(draft))
            (draft / "resume").touch()
            raise ZeroDivisionError
    assert seen == [[files.MARKER], [files.MARKER, "resume"], [files.MARKER]] and not out.exists()
    with KIND.replacing(out, resume=True) as draft:
        assert (draft / "resume").exists()
    assert names(tmp_path) == ["out"]


def test_work_in_place_that_was_interrupted_goes_on_and_takes_results_in(tmp_path: Path) -> None:
    """As a proof of hours: each file is whole by itself, and a second run finds whose the folder is."""
    out = tmp_path / "out"
    with pytest.raises(KeyboardInterrupt), KIND.in_place(out):
        (out / "a").write_text("first")
        raise KeyboardInterrupt
    with KIND.in_place(out), OTHER.replacing(out / "part"):
        assert (out / "a").read_text() == "first"
    with pytest.raises(InputError, match="not another result"), OTHER.in_place(out):
        pass


def test_an_older_recording_goes_when_the_newer_one_is_whole(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out, older = tmp_path / "out", tmp_path / "out.old"
    record(out, "first")
    with KIND.recording(out, overwrite=True, whole=lambda _: True):
        assert (older / "a").read_text() == "first"  # and nothing is recorded
    assert (out / "a").read_text() == "first" and names(tmp_path) == ["out"]
    record(out, "half", is_whole=False)
    assert (older / "a").read_text() == "first" and (out / "a").read_text() == "half"
    assert str(older) in capsys.readouterr().err
    record(out, "third")
    assert (out / "a").read_text() == "third" and names(tmp_path) == ["out", "out.old"]


def test_a_folder_is_locked_until_its_run_ends(tmp_path: Path) -> None:
    other = subprocess.Popen(
        [sys.executable, "-c", HOLD, str(tmp_path)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    try:
        assert other.stdout is not None and other.stdout.readline() == "held\n"
        with pytest.raises(InputError, match="another run is at work in"), files.writing(tmp_path):
            pass
    finally:
        other.kill()
        other.communicate()
    with files.writing(tmp_path):
        pass


def test_a_name_is_reserved_by_a_file_that_is_this_users_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    out = tmp_path / "out"
    for _ in range(2):
        with lock.reserved(out):
            assert (tmp_path / f"deeptruck-{os.getuid()}").stat().st_mode & 0o777 == 0o700
            with pytest.raises(InputError, match="another run is at work in"), lock.reserved(out):
                pass
    assert not out.exists()
