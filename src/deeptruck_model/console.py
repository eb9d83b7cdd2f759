"""How every console script ends: bad input is one line and exit code 2, never a traceback or a box."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import cache
from itertools import pairwise
from pathlib import Path
from types import FrameType

import typer
from typer.exceptions import TyperException
from typer.main import get_command

from deeptruck_model.errors import InputError

INTERRUPTED = 130
MISSING = "{name} is not installed; pip install 'deeptruck[{extra}]'"
EXTRA_OF = {  # of what a slim installation is without
    **dict.fromkeys(("torch", "safetensors", "onnx", "onnxruntime", "tensorboard"), "deep"),
    **dict.fromkeys(("gymnasium", "stable_baselines3", "sb3_contrib", "osqp"), "cacc"),
    **dict.fromkeys(("can", "cantools"), "can"),
    **dict.fromkeys(("fmpy", "pythonfmu3"), "fmu"),
    "libsumo": "sumo",
}
EXTRA_OF_PROGRAM = {"deeptruck-cacc": "cacc"}  # it needs what learns too, and its extra holds that


def run(
    app: typer.Typer, program: str, arguments: Sequence[str] | None = None, interrupted: str = "interrupted"
) -> None:
    """Run the commands of `app` on `arguments` (default: the command line) and exit.

    Exit codes: 0; 2 for bad input, and for a library of an extra that is not installed; 130 after Ctrl-C,
    SIGTERM or SIGHUP, with `interrupted` as the last word; 1 for a defect.
    """
    words = sys.argv[1:] if arguments is None else arguments
    try:
        _nothing_empty(words)
        # as a function, typer lets its errors out instead of drawing them over five lines
        with _ended_as_by_ctrl_c():
            code = _command(app)(words, prog_name=program, standalone_mode=False)
    except (InputError, TyperException) as error:
        if type(error).__name__ == "NoArgsIsHelpError":  # typer's, which gives it no public place
            print(error, file=sys.stderr)  # the help
            sys.exit(2)
        sys.exit(_last_words(program, _line(error), 2))
    except ModuleNotFoundError as error:
        library = (error.name or "").partition(".")[0]
        if library not in EXTRA_OF:
            raise
        extra = EXTRA_OF_PROGRAM.get(program, EXTRA_OF[library])
        sys.exit(_last_words(program, MISSING.format(name=library, extra=extra), 2))
    except OSError as error:
        what = error.strerror or str(error)
        sys.exit(_last_words(program, f"{error.filename}: {what}" if error.filename else what, 2))
    if code == INTERRUPTED:  # typer makes an exit code of Ctrl-C
        _last_words(program, interrupted, code)
    sys.exit(code if isinstance(code, int) else 0)


@cache
def _command(app: typer.Typer) -> Callable[..., object]:
    """What parses for `app`, made once a process: reading the signatures of all commands takes long."""
    app.rich_markup_mode = None  # help as plain text: the library that draws boxes takes longer than the help
    return get_command(app)


@contextmanager
def _ended_as_by_ctrl_c() -> Iterator[None]:
    """What a job queue or a closed terminal sends ends a command in order, unless it is ignored (nohup).

    A terminal's Ctrl-C reaches all processes of a command; so does this. It is sent to them as SIGTERM, which
    is not ignored by what a shell has started in the background.
    """

    def end(_number: int, _frame: FrameType | None) -> None:
        for process in _descendants():
            with suppress(ProcessLookupError):
                os.kill(process, signal.SIGTERM)
        raise KeyboardInterrupt

    before = {number: signal.getsignal(number) for number in (signal.SIGTERM, signal.SIGHUP)}
    ours = [number for number, handler in before.items() if handler is signal.SIG_DFL]
    for number in ours:
        signal.signal(number, end)
    try:
        yield
    finally:
        for number in ours:
            if signal.getsignal(number) is end:
                signal.signal(number, signal.SIG_DFL)


def _descendants() -> list[int]:
    """The processes that this one has started, and those that they have."""
    parent = {}
    for stat in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):
            parent[int(stat.parent.name)] = int(stat.read_text().rpartition(")")[2].split()[1])
    found = [os.getpid()]
    for process in found:  # grows as it goes
        found += [child for child, of in parent.items() if of == process]
    return found[1:]


def _nothing_empty(words: Sequence[str]) -> None:
    """Raises InputError for an option without its value, as of a shell variable that is not set: a path so
    empty is where the program stands."""
    for option, value in pairwise((*words, "-")):
        name, given, inside = option.partition("=")
        if name.startswith("--") and name != "--" and (not value or (given and not inside)):
            raise InputError(f"{name} is empty; give it a value")


def _line(error: InputError | TyperException) -> str:
    if isinstance(error, InputError):
        return str(error)
    says = " ".join(error.format_message().split())  # the parser's own words
    says = says.rstrip(".").replace(": Value error, ", ": ")
    return f"{says}; --help shows what it takes"


def _last_words(program: str, text: str, code: int) -> int:
    print(f"{program}: {text}", file=sys.stderr)
    return code
