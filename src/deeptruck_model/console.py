"""How every console script ends: bad input is one line and exit code 2, never a traceback or a box."""

from __future__ import annotations

import signal
import sys
from collections.abc import Sequence
from itertools import pairwise
from types import FrameType

import typer
from typer.exceptions import TyperException

from deeptruck_model.errors import InputError

INTERRUPTED = 130
MISSING = "{name} is not installed; pip install 'deeptruck[{extra}]'"
EXTRA_OF = {  # of what a slim installation is without
    **dict.fromkeys(("torch", "safetensors", "onnx", "tensorboard"), "deep"),
    **dict.fromkeys(("gymnasium", "stable_baselines3", "sb3_contrib", "osqp"), "cacc"),
    **dict.fromkeys(("can", "cantools"), "can"),
    **dict.fromkeys(("fmpy", "pythonfmu3"), "fmu"),
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
    _end_as_by_ctrl_c()
    app.rich_markup_mode = None  # help as plain text: the library that draws boxes takes longer than the help
    try:
        _nothing_empty(words)
        # as a function, typer lets its errors out instead of drawing them over five lines
        code = app(words, prog_name=program, standalone_mode=False)
    except (InputError, TyperException) as error:
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


def _end_as_by_ctrl_c() -> None:
    """What a job queue or a closed terminal sends ends a command in order, unless it is ignored (nohup)."""

    def end(_number: int, _frame: FrameType | None) -> None:
        raise KeyboardInterrupt

    for number in (signal.SIGTERM, signal.SIGHUP):
        if signal.getsignal(number) is signal.SIG_DFL:
            signal.signal(number, end)


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
    says = error.format_message().rstrip(".").replace(": Value error, ", ": ")  # the parser's own words
    return f"{says or 'say which command'}; --help shows what it takes"  # without one, the help came first


def _last_words(program: str, text: str, code: int) -> int:
    print(f"{program}: {text}", file=sys.stderr)
    return code
