from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from enum import StrEnum
from pathlib import Path

import pytest
import typer

from deeptruck_core.errors import InputError
from deeptruck_core.terminal import console, script_start


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
        (ALONE, signal.SIGHUP),
        (SIDE_BY_SIDE, signal.SIGTERM),
        (SIDE_BY_SIDE, signal.SIGINT),
        (SWALLOWED, signal.SIGINT),
        (MADE_ANOTHER, signal.SIGINT),
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


@pytest.mark.parametrize("package", ["deeptruck_model", "deeptruck_cacc", "truck_bridge"])
def test_a_script_that_is_interrupted_while_it_is_imported_says_one_line(
    tmp_path: Path, package: str
) -> None:
    """typer, which every console script imports first, is slow here."""
    program = {"truck_bridge": "truck-bridge"}.get(package, package.replace("_", "-"))
    (tmp_path / "typer.py").write_text("print('begun', flush=True)\n" + SLOW)
    (tmp_path / program).write_text(
        "import signal\nsignal.signal(signal.SIGINT, signal.default_int_handler)\n"
        f"from {package}.cli import main\nmain()\n"
    )
    assert ended(tmp_path, program, signal.SIGINT) == (130, [f"{program}: interrupted"])


def test_a_program_of_another_name_keeps_its_own_handler() -> None:
    assert signal.getsignal(signal.SIGINT) is not script_start.end_at_once


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
