from __future__ import annotations

import signal
import subprocess
import sys
import time
from enum import StrEnum
from pathlib import Path

import pytest
import typer

from deeptruck_model import console
from deeptruck_model.errors import InputError


class Colour(StrEnum):
    """A choice."""

    red = "red"


def outcome(
    capsys: pytest.CaptureFixture[str], raised: BaseException | None, *arguments: str
) -> tuple[int, str]:
    """Exit code and stderr of a program whose one command raises."""
    app = typer.Typer(add_completion=False)

    @app.command()
    def main(size: int, colour: Colour = Colour.red) -> None:
        if raised is not None:
            raise raised

    with pytest.raises(SystemExit) as ended:
        console.run(app, "tool", arguments, interrupted="interrupted; go on with --resume")
    return int(ended.value.code or 0), capsys.readouterr().err.removeprefix("\n")  # of the line with ^C


@pytest.mark.parametrize(
    ("raised", "code", "says"),
    [
        (None, 0, ""),
        (typer.Exit(1), 1, ""),
        (InputError("no such truck; try volvo"), 2, "tool: no such truck; try volvo\n"),
        (PermissionError(13, "Permission denied", "/x"), 2, "tool: /x: Permission denied\n"),
        (KeyboardInterrupt(), 130, "tool: interrupted; go on with --resume\n"),
    ],
)
def test_how_a_command_ends(
    capsys: pytest.CaptureFixture[str], raised: BaseException | None, code: int, says: str
) -> None:
    assert outcome(capsys, raised, "3") == (code, says)


PROGRAM = """
import signal, sys, time, typer
from pathlib import Path
from deeptruck_model import console, files, sweeps
signal.signal(signal.SIGINT, signal.default_int_handler)  # as at a terminal, wherever this test runs
signal.signal(signal.SIGHUP, signal.SIG_DFL)
app = typer.Typer()
@app.command()
def main() -> None:
    with files.Result('a result', ('a',)).replacing(Path('out')):
        print('begun', flush=True)
        WORK
if __name__ == '__main__':
    console.run(app, 'tool', [])
"""
ALONE, SIDE_BY_SIDE = "time.sleep(60)", "list(sweeps.run(time.sleep, [60, 60], workers=2))"


@pytest.mark.parametrize(
    ("work", "number"),
    [(ALONE, signal.SIGINT), (ALONE, signal.SIGTERM), (ALONE, signal.SIGHUP), (SIDE_BY_SIDE, signal.SIGTERM)],
)
def test_a_command_that_is_ended_leaves_nothing_under_a_final_name(
    tmp_path: Path, work: str, number: signal.Signals
) -> None:
    """As a job queue or a closed terminal ends it, which do not reach the processes that it has started."""
    (tmp_path / "tool.py").write_text(PROGRAM.replace("WORK", work))
    run = subprocess.Popen(
        [sys.executable, "tool.py"], cwd=tmp_path, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    try:
        assert run.stdout is not None and run.stdout.readline() == "begun\n"
        if work == SIDE_BY_SIDE:
            time.sleep(2.0)  # the workers are there
        run.send_signal(number)
        _, errors = run.communicate(timeout=30)
    finally:
        run.kill()
        run.wait()
    assert run.returncode == 130 and errors.splitlines()[-1] == "tool: interrupted"
    assert [path.name for path in tmp_path.iterdir() if path.name != "__pycache__"] == ["tool.py"]


@pytest.mark.parametrize("arguments", [("3", "--colour", ""), ("3", "--colour=")])
def test_an_empty_value_is_said_to_be_empty(
    capsys: pytest.CaptureFixture[str], arguments: tuple[str, ...]
) -> None:
    assert outcome(capsys, None, *arguments) == (2, "tool: --colour is empty; give it a value\n")


@pytest.mark.parametrize("arguments", [(), ("a",), ("3", "--nope"), ("3", "--colour", "blue")])
def test_a_wrong_command_line_is_one_line(
    capsys: pytest.CaptureFixture[str], arguments: tuple[str, ...]
) -> None:
    code, says = outcome(capsys, None, *arguments)
    assert code == 2 and says.startswith("tool: ") and says.endswith("--help shows what it takes\n")
    assert says.count("\n") == 1 and "Value error" not in says
