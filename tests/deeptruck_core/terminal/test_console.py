from __future__ import annotations

import errno
import os
import signal
import subprocess
import sys
import time
from enum import StrEnum
from pathlib import Path

import pytest
import typer
from tensorboard.summary.writer.record_writer import RecordWriter

from deeptruck_core.errors import InputError
from deeptruck_core.terminal import console
from deeptruck_core.terminal.interrupts import may_raise
from deeptruck_core.terminal.progress import bar, board, progress


class Colour(StrEnum):
    """A choice."""

    red = "red"


def outcome(
    capsys: pytest.CaptureFixture[str], raised: BaseException | None, *arguments: str
) -> tuple[int, str]:
    """Exit code and stderr of a program whose one command raises."""
    app = typer.Typer(add_completion=False)

    @app.command()
    def main(size: int, colour: Colour = Colour.red, resume: bool = False) -> None:
        if raised is not None:
            raise raised

    with pytest.raises(SystemExit) as ended:
        console.run(app, "tool", arguments)
    return int(ended.value.code or 0), capsys.readouterr().err.removeprefix("\n")  # of the line with ^C


@pytest.mark.parametrize(
    ("raised", "code", "says"),
    [
        (None, 0, ""),
        (typer.Exit(1), 1, ""),
        (InputError("no such truck; try volvo"), 2, "tool: no such truck; try volvo\n"),
        (PermissionError(13, "Permission denied", "/x"), 2, "tool: /x: Permission denied\n"),
        (KeyboardInterrupt(), 130, "tool: interrupted; nothing was saved yet\n"),
    ],
)
def test_how_a_command_ends(
    capsys: pytest.CaptureFixture[str], raised: BaseException | None, code: int, says: str
) -> None:
    assert outcome(capsys, raised, "3") == (code, says)


PROGRAM = """
import signal, sys, time, typer
from pathlib import Path
from deeptruck_core.terminal import console
from deeptruck_core import files
from deeptruck_exam.jobs import in_parallel
signal.signal(signal.SIGINT, signal.default_int_handler)  # as at a terminal, wherever this test runs
signal.signal(signal.SIGHUP, signal.SIG_DFL)
app = typer.Typer()
def wait() -> None:
    while True:
        time.sleep(0.05)  # a signal just before a long sleep would be heeded after it
@app.command()
def main() -> None:
    with files.Result('a result', ('a',)).replacing(Path('out')):
        print('begun', flush=True)
        WORK
if __name__ == '__main__':
    console.run(app, 'tool', [])
"""
ALONE, SIDE_BY_SIDE = "wait()", "list(in_parallel(time.sleep, [60, 60], 2, 'naps'))"
SWALLOWED = """
        while True:
            try:
                wait()
            except KeyboardInterrupt:
                pass
"""
MADE_ANOTHER = """
        try:
            wait()
        except KeyboardInterrupt:
            raise RuntimeError("of a compiler")
"""
IN_A_DESTRUCTOR = """
        class Slow:
            def __del__(self):
                wait()
        Slow()
        wait()
"""
IN_AN_IMPORT = "import slow"
SLOW = "import time\nwhile True:\n    time.sleep(0.05)\n"
BEGUN = "begun\n"


def ended(folder: Path, program: str, number: signal.Signals, after: float = 0.0) -> tuple[int, list[str]]:
    """Exit code and last words of a program that says when it has begun, ended as a terminal does it."""
    run = subprocess.Popen(
        [sys.executable, program],
        cwd=folder,
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        start_new_session=True,
    )
    try:
        assert run.stdout is not None and run.stdout.readline() == BEGUN
        time.sleep(after)
        os.killpg(run.pid, number) if number is signal.SIGINT else run.send_signal(number)
        _, errors = run.communicate(timeout=240)
    finally:
        run.kill()
        run.wait()
    return run.returncode, errors.splitlines()


@pytest.mark.parametrize(
    ("work", "number"),
    [
        (ALONE, signal.SIGINT),
        (ALONE, signal.SIGTERM),
        (SIDE_BY_SIDE, signal.SIGINT),
        (SWALLOWED, signal.SIGINT),
        (IN_A_DESTRUCTOR, signal.SIGINT),
        (IN_AN_IMPORT, signal.SIGINT),
    ],
)
def test_a_command_that_is_ended_leaves_nothing_and_says_one_line(
    tmp_path: Path, work: str, number: signal.Signals
) -> None:
    """Also where the interrupt is lost on its way, and where other processes work for the command."""
    (tmp_path / "slow.py").write_text(SLOW)
    (tmp_path / "tool.py").write_text(PROGRAM.replace("WORK", work.strip()))
    workers_start_s = 2.0 if work == SIDE_BY_SIDE else 0.0
    assert ended(tmp_path, "tool.py", number, workers_start_s) == (130, ["tool: interrupted"])
    left = {path.name for path in tmp_path.iterdir()} - {"__pycache__", "slow.py"}
    assert left == {"tool.py"}


def test_a_script_that_is_interrupted_while_it_is_imported_says_one_line(tmp_path: Path) -> None:
    """typer, which every console script imports first, is slow here."""
    (tmp_path / "typer.py").write_text("print('begun', flush=True)\n" + SLOW)
    (tmp_path / "truck-bridge").write_text(
        "import signal\nsignal.signal(signal.SIGINT, signal.default_int_handler)\n"
        "from truck_bridge.cli import main\nmain()\n"
    )
    assert ended(tmp_path, "truck-bridge", signal.SIGINT) == (130, ["truck-bridge: interrupted"])


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ("", "--help"),
        ("a", "--help"),
        ("3 --nope", "--help"),
        ("3 --colour blue", "--help"),
        ("3 --colour=", "--colour is empty"),
    ],
)
def test_a_wrong_command_line_is_one_line(
    capsys: pytest.CaptureFixture[str], arguments: str, says: str
) -> None:
    code, errors = outcome(capsys, None, *arguments.split())
    assert code == 2 and errors.startswith("tool: ") and says in errors and errors.count("\n") == 1


# An interrupt may come at any moment, also while numba takes over arguments or gives back results


SCRIPT = """
import random, signal
import numpy as np
from deeptruck_core.imports.compiler import numba
from deeptruck_core.terminal.interrupts import may_raise

@numba.njit
def run(x):
    return x + 1.0, x * 2.0

held = 0
def handler(_, frame):
    global held
    if ALWAYS or may_raise(frame):
        raise KeyboardInterrupt
    held += 1
    signal.setitimer(signal.ITIMER_REAL, 1e-4)

x, draw = np.zeros((1, 300, 3)), random.Random(0)
run(x)
signal.signal(signal.SIGALRM, handler)
for _ in range(300):
    try:
        signal.setitimer(signal.ITIMER_REAL, draw.uniform(1e-5, 1e-3))
        while True:
            run(x)
    except KeyboardInterrupt:
        pass
print("held back" if held else "never inside")
"""


def _interrupted(always: bool) -> subprocess.CompletedProcess[str]:
    source = SCRIPT.replace("ALWAYS", str(always))
    return subprocess.run(
        [sys.executable, "-c", source], capture_output=True, text=True, timeout=200, check=False
    )


def test_compiled_code_survives_every_interrupt() -> None:
    run = _interrupted(always=False)
    assert (run.returncode, run.stdout) == (0, "held back\n"), run.stderr


@pytest.mark.parametrize(
    ("name", "may"),
    [("numba.core.serialize", False), ("importlib._bootstrap", False), ("numbas", True), ("__main__", True)],
)
def test_where_an_exception_may_be_raised(name: str, may: bool) -> None:
    space = {"__name__": name}
    exec("import sys\ndef here(): return sys._getframe()", space)
    assert may_raise(space["here"]()) is may  # type: ignore[operator]


# Progress


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
