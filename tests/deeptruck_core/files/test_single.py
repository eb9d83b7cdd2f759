"""A single file is whole or not there, and never takes the place of another."""

from __future__ import annotations

import os
import resource
from pathlib import Path

import pytest
from result_kit import KIND, publish

from deeptruck_core import files
from deeptruck_core.errors import InputError


@pytest.fixture
def small_disk():
    """A limit on the size of files stands in for the end of the disk."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, before[1]))
    yield
    resource.setrlimit(resource.RLIMIT_FSIZE, before)


def test_a_full_disk_leaves_the_old_file_and_nothing_beside_it(tmp_path: Path, small_disk: None) -> None:
    path = tmp_path / "new" / "file"
    files.write(path, b"old")
    with pytest.raises(InputError, match=r"cannot write .*; make room or choose another --out"):
        files.write(path, bytes(2000))
    assert [p.name for p in path.parent.iterdir()] == ["file"] and path.read_bytes() == b"old"


def test_everyone_may_read_it_whom_the_umask_lets(tmp_path: Path) -> None:
    before = os.umask(0o022)
    try:
        files.write(tmp_path / "file", b"x")
    finally:
        os.umask(before)
    assert (tmp_path / "file").stat().st_mode & 0o777 == 0o644


def test_a_finished_file_is_kept_where_another_came_to_its_place(tmp_path: Path) -> None:
    path, kept = tmp_path / "a.csv", tmp_path / "a.new.csv"
    with pytest.raises(InputError, match=f"kept as {kept}$"), files.new_file(path) as draft:
        draft.write_text("new")
        path.write_text("mine")
    assert kept.read_text() == "new" and path.read_text() == "mine"
    assert len(list(tmp_path.iterdir())) == 2


@pytest.mark.parametrize("name", ["n" * 250, "ä" * 122])
def test_a_name_that_is_too_long_is_one_line(tmp_path: Path, name: str) -> None:
    """Whatever fits alone, but not with what is written beside it, and whatever does not fit at all."""
    for longer in (name, name * 2):
        with pytest.raises(InputError, match="File name too long; choose another --out"):
            KIND.check(tmp_path / longer)
        with (
            pytest.raises(InputError, match="File name too long; choose another name"),
            files.new_file(tmp_path / (longer * 2)),
        ):
            pass
    longest = tmp_path / ("n" * 230)
    publish(longest, a="1")
    publish(longest, overwrite=True, a="2")
    assert len(list(tmp_path.iterdir())) == 1


def test_what_a_killed_run_left_of_a_single_file_is_named_and_stays(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    left = tmp_path / ".a.k3x_9qz1.csv"
    left.write_text("half")
    with files.new_file(tmp_path / "a.csv") as draft:
        draft.write_text("1")
    assert f"note: {left} is unfinished work on a.csv" in capsys.readouterr().err
    assert left.read_text() == "half" and (tmp_path / "a.csv").read_text() == "1"
