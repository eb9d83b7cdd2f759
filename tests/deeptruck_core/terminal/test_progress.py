from __future__ import annotations

import errno
import os
import time
from pathlib import Path

import pytest
from tensorboard.summary.writer.record_writer import RecordWriter

from deeptruck_core.terminal.progress import bar, board, progress


def test_a_log_gets_lines_with_the_time_left_once_it_can_be_estimated(
    capsys: pytest.CaptureFixture[str],
) -> None:
    with bar("training", every_s=0.0) as show:
        for done in (0, 5, 100, 200):
            show(done, 300, "")
    lines = capsys.readouterr().err.splitlines()
    assert [" left" in line for line in lines] == [False, False, True, True]


def test_a_long_step_is_repeated(capsys: pytest.CaptureFixture[str]) -> None:
    shown = ""
    with progress("reading", every_s=0.01, quiet_s=0.01):
        while "still reading" not in shown:  # the test ends by its own time limit otherwise
            time.sleep(0.01)
            shown += capsys.readouterr().err


def test_a_short_one_is_silent(capsys: pytest.CaptureFixture[str]) -> None:
    with bar("training") as show, progress("reading") as say:
        show(1, 2, "")
        say("driving")
    assert capsys.readouterr().err == ""


def test_a_log_gets_one_line_for_a_step_however_often_it_says_how_far_it_is(
    capsys: pytest.CaptureFixture[str],
) -> None:
    shown = ""
    with progress("reading", quiet_s=0.02) as say:
        while "reading" not in shown:  # the test ends by its own time limit otherwise
            time.sleep(0.01)
            shown += capsys.readouterr().err
        for k in range(100):
            say(f"driving, {k}%")
        say("writing the report")
    assert [line.partition(": ")[2] for line in (shown + capsys.readouterr().err).splitlines()] == [
        "reading", "driving, 0%", "writing the report"
    ]  # fmt: skip


def test_a_full_disk_is_said_by_whoever_writes_and_by_nobody_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(RecordWriter, "write", full)
    with pytest.raises(OSError, match="No space left"):
        _write_until_it_fails(tmp_path)
    assert capsys.readouterr().err == ""


def _write_until_it_fails(folder: Path) -> None:
    curves = board(folder, 0)
    for step in range(100):
        curves.add_scalar("loss", 1.0, step)
        time.sleep(0.01)
