"""A program that only looks on: nobody waits for it, and its death is not the run's."""

from __future__ import annotations

import signal
import sys
from pathlib import Path
from typing import Any

import pytest

from deeptruck_nodes import supervisor
from deeptruck_nodes.environment import DOMAIN, ENDED
from deeptruck_nodes.supervisor import REVIVALS, Program, Supervisor


def program(name: str, code: str, **options: Any) -> Program:
    return Program(name, (sys.executable, "-c", code), says_ready=False, **options)


def run(folder: Path, *programs: Program) -> tuple[int, Supervisor]:
    with (folder / "lock").open("w") as lock:
        over = Supervisor(folder, programs, {DOMAIN: "1"}, lock.fileno())
        return over.run(240.0), over


def lasting(marks: Path, count: int) -> Program:
    """One that drives until a file has `count` lines, and no process is left that the last one names."""
    code = f"""
import time
from pathlib import Path
marks = Path({str(marks)!r})
def pids(): return marks.read_text().splitlines() if marks.exists() else []
while len(pids()) < {count} or Path("/proc", pids()[-1]).exists(): time.sleep(0.05)
"""
    return program("driving", code, ends_run=True)


def test_one_that_cannot_live_is_left_out(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    marks = tmp_path / "marks"
    dies = f"import os; print(os.getpid(), file=open({str(marks)!r}, 'a')); raise SystemExit('no room')"
    driving, dying = lasting(marks, REVIVALS), program("page", dies, spectator=True)
    code, _ = run(tmp_path, dying, driving)
    said = capsys.readouterr().err.splitlines()
    assert code == 0 and len(said) == REVIVALS
    assert said[0] == "page ended (exit code 1): no room; it is started again"
    assert said[-1] == "page ended (exit code 1): no room; the run goes on without it"


def test_one_that_was_killed_is_started_with_what_it_had(tmp_path: Path) -> None:
    marks = tmp_path / "marks"
    code = f"""
import os, signal
with open({str(marks)!r}, "a") as file: print(os.environ["WORD"], file=file)
if open({str(marks)!r}).read().count("word") == 1: os.kill(os.getpid(), signal.SIGKILL)
import time; time.sleep(60)
"""
    driving = lasting(marks, 2)
    assert run(tmp_path, program("page", code, spectator=True, environment={"WORD": "word"}), driving)[0] == 0
    assert marks.read_text() == "word\nword\n"


def test_one_that_hangs_is_not_waited_for_and_why_the_run_ended_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(supervisor, "PATIENCE", ((signal.SIGINT, 3600.0),))  # for which no test would wait
    hangs = "import signal, time\nfor n in (2, 15): signal.signal(n, signal.SIG_IGN)\ntime.sleep(3600)"
    driving = program("driving", "import time; time.sleep(1)", ends_run=True)
    code, over = run(tmp_path, program("page", hangs, spectator=True), driving)
    assert code == 0
    assert (tmp_path / ENDED).read_text() == f"{over.why}\n" == "driving has finished\n"
