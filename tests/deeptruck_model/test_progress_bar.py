"""What a long command writes where nobody watches a terminal."""

from __future__ import annotations

import time

import pytest

from deeptruck_model.cli.progress import progress
from deeptruck_model.progress_bar import bar


def test_a_log_gets_a_line_now_and_then_with_the_time_left(capsys: pytest.CaptureFixture[str]) -> None:
    with bar("training", every_s=0.0) as show:
        show(100, 300, "")
        show(200, 300, "validation 0.1")
    lines = capsys.readouterr().err.splitlines()
    assert lines[0] == "training: 100 of 300" and lines[1].startswith("training: 200 of 300, about ")
    assert lines[1].endswith(" left; validation 0.1")


def test_a_short_one_is_silent(capsys: pytest.CaptureFixture[str]) -> None:
    with bar("training") as show, progress("reading") as say:
        show(1, 2, "")
        say("driving")
    assert capsys.readouterr().err == ""


def test_a_long_step_is_repeated(capsys: pytest.CaptureFixture[str]) -> None:
    said = ""
    with progress("reading", every_s=0.01):
        while "still reading" not in said:  # the test ends by its own time limit otherwise
            time.sleep(0.01)
            said += capsys.readouterr().err
