import errno
import os
import resource
from pathlib import Path

import pytest

from deeptruck_model import whole_file
from deeptruck_model.errors import InputError


@pytest.fixture
def small_disk():
    """A limit on the size of files stands in for the end of the disk."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, before[1]))
    yield
    resource.setrlimit(resource.RLIMIT_FSIZE, before)


def test_a_full_disk_leaves_the_old_file_and_nothing_beside_it(tmp_path: Path, small_disk: None) -> None:
    path = tmp_path / "new" / "file"
    whole_file.write(path, b"old")
    with pytest.raises(InputError, match=r"cannot write .*; make room or choose another --out"):
        whole_file.write(path, bytes(2000))
    assert [p.name for p in path.parent.iterdir()] == ["file"] and path.read_bytes() == b"old"


def test_everyone_may_read_it_whom_the_umask_lets(tmp_path: Path) -> None:
    before = os.umask(0o022)
    try:
        whole_file.write(tmp_path / "file", b"x")
    finally:
        os.umask(before)
    assert (tmp_path / "file").stat().st_mode & 0o777 == 0o644


def test_a_folder_that_is_a_file_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("x")
    with pytest.raises(InputError, match=r"cannot write .*; choose another --out"):
        whole_file.write(tmp_path / "file" / "below", b"x")


def test_files_that_belong_together_come_together_or_not_at_all(tmp_path: Path, small_disk: None) -> None:
    (tmp_path / "a").write_bytes(b"old")
    with pytest.raises(InputError, match="make room"), whole_file.together(tmp_path) as draft:
        (draft / "a").write_bytes(b"new")
        (draft / "b").write_bytes(bytes(2000))
    assert [p.name for p in tmp_path.iterdir()] == ["a"] and (tmp_path / "a").read_bytes() == b"old"
    with whole_file.together(tmp_path) as draft:
        (draft / "a").write_bytes(b"new")
    assert [p.name for p in tmp_path.iterdir()] == ["a"] and (tmp_path / "a").read_bytes() == b"new"


def test_a_folder_is_tried_and_left_as_it_was(tmp_path: Path) -> None:
    whole_file.check_folder(tmp_path / "new")
    assert not list(tmp_path.iterdir())
    (tmp_path / "file").write_text("x")
    for folder in (tmp_path / "file", tmp_path / "file" / "below"):
        with pytest.raises(InputError, match=r"cannot write .*; choose another --out"):
            whole_file.check_folder(folder)


@pytest.mark.parametrize("number", [errno.ENOTDIR, errno.EROFS, errno.EACCES])
def test_room_helps_a_full_disk_alone(number: int) -> None:
    assert whole_file.advice(OSError(number, ""), "make room") == "choose another --out"
    assert whole_file.advice(OSError(errno.ENOSPC, ""), "make room") == "make room"
