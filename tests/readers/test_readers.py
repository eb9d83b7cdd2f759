"""Every reader on damaged files, and on what is no file: as before, or one line; never anything else."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import pytest
from damage import BYTES, OTHER, REFUSED, Reader, fuzz, judge, limited, mutants, same
from kinds import READERS

from deeptruck_core.errors import InputError

SHORT, LONG = 20, 1000
every_reader = pytest.mark.parametrize("reader", READERS, ids=[reader.name for reader in READERS])
CAN_BE_EMPTY = ("truck overrides",)  # an empty file changes nothing


@every_reader
def test_a_few_damaged_files(tmp_path: Path, reader: Reader) -> None:
    outcomes, defects = fuzz(reader, tmp_path, SHORT)
    assert not defects, "\n".join(defects)
    assert outcomes[REFUSED] > 0 and outcomes.total() == SHORT


@pytest.mark.hours
@pytest.mark.timeout(1200)
@every_reader
def test_a_thousand_damaged_files(tmp_path: Path, reader: Reader) -> None:
    outcomes, defects = fuzz(reader, tmp_path, LONG, seed=1)
    print(f"{reader.name}: {dict(outcomes)}")
    assert not defects, "\n".join(defects)


@every_reader
def test_what_is_no_file(tmp_path: Path, reader: Reader) -> None:
    file = reader.make(tmp_path)
    expected = reader.read(file)
    for replace in (_empty, _folder, _pipe, _device, _dangling):
        shutil.rmtree(file) if file.is_dir() and not file.is_symlink() else file.unlink()
        replace(file)
        wanted = {REFUSED, OTHER} if replace is _empty and reader.name in CAN_BE_EMPTY else {REFUSED}
        assert judge(reader, file, expected) in wanted, replace.__name__


@pytest.mark.skipif(os.geteuid() == 0, reason="root may read everything")
@every_reader
def test_a_file_that_may_not_be_read(tmp_path: Path, reader: Reader) -> None:
    file = reader.make(tmp_path)
    expected = reader.read(file)
    file.chmod(0)
    assert judge(reader, file, expected) == REFUSED


def _empty(file: Path) -> None:
    file.touch()


def _folder(file: Path) -> None:
    file.mkdir()


def _pipe(file: Path) -> None:
    os.mkfifo(file)


def _device(file: Path) -> None:
    file.symlink_to("/dev/null")


def _dangling(file: Path) -> None:
    file.symlink_to(file.with_name("gone"))


def test_the_judge_sees_each_kind_of_defect(tmp_path: Path) -> None:
    """A reader that fails in every way: what is asserted above would be nothing without this."""

    def make(folder: Path) -> Path:
        (folder / "file").write_bytes(b"valid")
        return folder / "file"

    def raising(error: BaseException) -> Reader:
        def read(file: Path) -> bytes:
            if file.read_bytes() != b"valid":
                raise error
            return b"valid"

        return Reader("raising", make, read)

    for error in (OverflowError("x"), InputError("file\nsecond line"), InputError("no name"), MemoryError()):
        outcomes, defects = fuzz(raising(error), tmp_path, 8)
        assert outcomes["defect"] > 0 and defects
    assert fuzz(raising(InputError(f"{tmp_path / 'file'} is damaged")), tmp_path, 8)[1] == []
    silent = Reader("silent", make, lambda file: file.read_bytes(), checked=True)
    assert any("without a word" in defect for defect in fuzz(silent, tmp_path, 8)[1])


def test_memory_and_time_are_limited(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(MemoryError), limited():
        bytearray(2 * BYTES)
    monkeypatch.setattr("damage.SECONDS", 0.05)
    endless = Reader("endless", lambda folder: folder, lambda file: all(x == 0 for x in iter(int, 1)))
    assert "no end within" in judge(endless, tmp_path, None)


def test_mutants_are_the_same_for_a_seed() -> None:
    data = bytes(range(256))
    assert list(mutants(data, 40, 3)) == list(mutants(data, 40, 3))
    assert sum(one != data for one in mutants(data, 40, 3)) > 36
    assert same([float("nan"), {"a": 1}], [float("nan"), {"a": 1}]) and not same([1], [1, 2])
