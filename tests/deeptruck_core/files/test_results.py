"""Results are whole or not there, one run at a time, and nothing of the user's is lost."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path

import pytest
from result_kit import KIND, publish, record

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


def test_a_second_run_is_refused_until_the_first_ends(tmp_path: Path) -> None:
    files.free(tmp_path / "nowhere")
    other = subprocess.Popen(
        [sys.executable, "-c", HOLD, str(tmp_path)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    try:
        assert other.stdout is not None and other.stdout.readline() == "held\n"
        with pytest.raises(InputError, match="another run is at work in"):
            files.free(tmp_path)
    finally:
        other.kill()
        other.communicate()
    with files.writing(tmp_path):
        pass


def test_a_result_stands_whole_and_its_draft_is_gone(tmp_path: Path) -> None:
    publish(tmp_path / "new" / "out", a="1", b="2")
    assert sorted(p.name for p in (tmp_path / "new").iterdir()) == ["out"]
    assert (tmp_path / "new" / "out" / "b").read_text() == "2"


def test_a_draft_is_the_commands_from_its_beginning_and_one_runs_alone(tmp_path: Path) -> None:
    with KIND.replacing(tmp_path / "out") as draft:
        assert KIND.marked(draft)
        with pytest.raises(InputError, match="another run is at work in"):
            KIND.check(tmp_path / "out")


def test_an_older_result_is_replaced_only_where_the_user_says_so(tmp_path: Path) -> None:
    publish(tmp_path / "out", a="old", gone="old")
    with pytest.raises(InputError, match=r"holds a test result already; .*--overwrite"):
        publish(tmp_path / "out", a="new")
    publish(tmp_path / "out", overwrite=True, a="new")
    assert {p.name for p in (tmp_path / "out").iterdir()} == {"a", files.MARKER}
    assert [p.name for p in tmp_path.iterdir()] == ["out"]


def test_a_path_may_go_back_through_the_result_itself(tmp_path: Path) -> None:
    publish(tmp_path / "out", a="old")
    publish(tmp_path / "out" / ".." / "out", overwrite=True, a="new")
    assert (tmp_path / "out" / "a").read_text() == "new"
    assert [p.name for p in tmp_path.iterdir()] == ["out"]


def test_another_commands_result_is_never_replaced(tmp_path: Path) -> None:
    publish(tmp_path / "out", a="old")
    other = files.Result("another result")
    with (
        pytest.raises(InputError, match="no part of another result"),
        other.replacing(tmp_path / "out", overwrite=True),
    ):
        pass


def test_a_link_or_a_file_as_out_is_refused_at_once(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("x")
    (tmp_path / "link").symlink_to(tmp_path)
    for name, says in (("file", "is a file"), ("link", "is a symbolic link"), ("file/below", "is no folder")):
        with pytest.raises(InputError, match=says):
            KIND.check(tmp_path / name)


@pytest.mark.parametrize("way", [KIND.replacing, KIND.going_on])
@pytest.mark.parametrize("older", [True, False])
def test_what_is_finished_is_kept_where_something_else_came_to_its_place(
    tmp_path: Path, way: Callable[..., AbstractContextManager[Path]], older: bool
) -> None:
    out = tmp_path / "out"
    if older:
        publish(out, a="old")
    for kept in (tmp_path / "out.new", tmp_path / "out.new1"):
        says = f"out holds mine.txt.*; the new one is whole, it is kept as {kept}$"
        with pytest.raises(InputError, match=says), way(out, overwrite=True) as draft:
            (draft / "a").write_text("new")
            (out / "mine.txt").write_text("mine")
        (out / "mine.txt").rename(tmp_path / "mine.txt")
        assert (kept / "a").read_text() == "new" and KIND.check(kept, overwrite=True)
        assert {p.name for p in out.glob("*")} - {files.MARKER} == ({"a"} if older else set())
    assert {p.name for p in tmp_path.iterdir()} <= {"out", "out.new", "out.new1", "mine.txt"}


def test_unfinished_work_is_gone_on_with(tmp_path: Path) -> None:
    out = tmp_path / "out"
    with pytest.raises(ZeroDivisionError), KIND.going_on(out) as draft:
        (draft / "log").mkdir()
        (draft / "log" / "1.txt").write_text("begun")
        raise ZeroDivisionError
    assert not out.exists()
    with KIND.going_on(out) as draft:
        assert (draft / "log" / "1.txt").read_text() == "begun"
    assert (out / "log" / "1.txt").exists() and not files.unfinished(out).exists()


def test_work_in_place_that_was_interrupted_is_known_as_the_commands_and_goes_on(tmp_path: Path) -> None:
    """As a proof of hours: each file is whole by itself, and a second run finds whose the folder is."""
    out = tmp_path / "out"
    with pytest.raises(KeyboardInterrupt), KIND.in_place(out):
        (out / "a").write_text("first")
        raise KeyboardInterrupt
    assert KIND.marked(out)
    with KIND.in_place(out):
        assert (out / "a").read_text() == "first"
        (out / "b").write_text("second")
    with (
        pytest.raises(InputError, match="no part of another result"),
        files.Result("another result").in_place(out),
    ):
        pass


def test_the_older_recording_stands_until_the_newer_one_is_whole(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    assert record(out, "first") == out
    kept = record(out, "half", is_whole=False)
    assert (out / "a").read_text() == "first" and (kept / "a").read_text() == "half"
    assert f"it is kept as {kept}" in capsys.readouterr().err
    assert record(out, "third") not in (out, kept) and (out / "a").read_text() == "third"
    assert {path.name for path in tmp_path.iterdir()} == {"out", kept.name}


def test_two_recordings_to_one_new_name_are_told_of_each_other(tmp_path: Path) -> None:
    out = tmp_path / "out"
    with KIND.recording(out, whole=lambda _: True):
        says = f"another run is to write {out}; wait until it has ended, or choose"
        with pytest.raises(InputError, match=says), KIND.recording(out, whole=lambda _: True):
            pass
        with KIND.recording(tmp_path / "other", whole=lambda _: True):
            pass
    record(out, "1")


def test_where_nothing_was_recorded_the_older_one_stands(tmp_path: Path) -> None:
    out = tmp_path / "out"
    record(out, "first")
    with KIND.recording(out, overwrite=True, whole=lambda _: True):
        assert (out / "a").read_text() == "first"
    assert (out / "a").read_text() == "first" and [p.name for p in tmp_path.iterdir()] == ["out"]


def test_what_another_command_left_unfinished_is_not_gone_on_with(tmp_path: Path) -> None:
    out, other = tmp_path / "out", files.Result("another thing")
    with pytest.raises(ZeroDivisionError), other.going_on(out) as draft:
        (draft / "a").write_text("begun")
        raise ZeroDivisionError
    with pytest.raises(InputError, match="is unfinished work on another thing"), KIND.going_on(out):
        pass
    with pytest.raises(InputError, match="is unfinished work on another thing"):
        KIND.check_start(out, resume=True)
    assert (draft / "a").read_text() == "begun"


# A name is held for one run at a time, by a file that is this user's alone


def test_a_name_is_reserved_once_at_a_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    out = tmp_path / "out"
    for _ in range(2):
        with lock.reserved(out):
            assert (tmp_path / f"deeptruck-{os.getuid()}").stat().st_mode & 0o777 == 0o700
            with pytest.raises(InputError, match="another run is to write"), lock.reserved(out):
                pass
    assert not out.exists()


# The marker of a result: which command wrote which files


def test_nothing_new_is_put_into_a_finished_result(tmp_path: Path) -> None:
    publish(tmp_path / "out", a="old")
    with pytest.raises(InputError, match=r"out/sub would lie in .*out, a test result; choose"):
        files.Result("another result").check(tmp_path / "out" / "sub")


@pytest.mark.parametrize(
    "text",
    [
        "",
        "{",
        "[]",
        '{"what": 1}',
        '{"what": "a test result", "files": 3}',
    ],
)
def test_a_damaged_marker_is_none(tmp_path: Path, text: str) -> None:
    publish(tmp_path / "out", a="old")
    (tmp_path / "out" / files.MARKER).write_text(text)
    with pytest.raises(InputError, match=r"holds a but no \.deeptruck\.json that can be read"):
        publish(tmp_path / "out", overwrite=True, a="new")
    assert (tmp_path / "out" / "a").read_text() == "old"


def test_what_an_earlier_version_wrote_is_known(tmp_path: Path) -> None:
    """It listed size and hash of each file."""
    publish(tmp_path / "out", a="old")
    old = {"what": "a test result", "files": {"a": {"bytes": 3, "sha256": "0"}}}
    (tmp_path / "out" / files.MARKER).write_text(json.dumps(old))
    publish(tmp_path / "out", overwrite=True, b="new")
    assert {p.name for p in (tmp_path / "out").iterdir()} == {"b", files.MARKER}


def test_a_marker_that_lists_files_elsewhere_removes_none_of_them(tmp_path: Path) -> None:
    publish(tmp_path / "out", a="old")
    (tmp_path / "mine").write_text("mine")
    (tmp_path / "out" / files.MARKER).write_text('{"what": "a test result", "files": ["a", "../mine"]}')
    publish(tmp_path / "out", overwrite=True, a="new")
    assert (tmp_path / "mine").read_text() == "mine"
