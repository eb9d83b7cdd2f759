"""The curves of a training on a disk that is full."""

from __future__ import annotations

import errno
import os
import threading
import time
from pathlib import Path

import pytest
from tensorboard.summary.writer.record_writer import RecordWriter

from deeptruck_model.deep.board import board


def test_a_full_disk_is_said_by_whoever_writes_and_by_nobody_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(RecordWriter, "write", full)
    with pytest.raises(OSError, match="No space left"):
        _write_until_it_fails(tmp_path)
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize("error", [ValueError("wrong"), OSError("wrong")])
def test_errors_of_other_threads_are_reported_as_before(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, error: Exception
) -> None:
    heard: list[threading.ExceptHookArgs] = []
    monkeypatch.setattr(threading, "excepthook", heard.append)

    def fail() -> None:
        raise error

    for _ in range(2):  # a second board adds nothing
        board(tmp_path, 0).close()
    thread = threading.Thread(target=fail)
    thread.start()
    thread.join()
    assert [given.exc_value for given in heard] == [error]


def _write_until_it_fails(folder: Path) -> None:
    curves = board(folder, 0)
    for step in range(100):
        curves.add_scalar("loss", 1.0, step)
        time.sleep(0.01)
