"""Runs console scripts: bad input is reported in one plain line, with exit code 2."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from enum import Enum
from functools import cache
from itertools import pairwise
from typing import Any, Literal, get_args, get_origin

import typer
from typer.exceptions import TyperException
from typer.main import get_command

from deeptruck_core import files
from deeptruck_core.errors import InputError
from deeptruck_core.terminal import interrupts
from deeptruck_core.terminal.script_start import INTERRUPTED

MISSING = "{name} is not installed; pip install 'deeptruck[{extra}]'"
EXTRA_OF = {  # of what a slim installation is without
    **dict.fromkeys(("torch", "safetensors", "onnx", "onnxscript", "tensorboard"), "deep"),
    **dict.fromkeys(("gymnasium", "stable_baselines3"), "cacc"),
    **dict.fromkeys(("can", "cantools"), "can"),
    **dict.fromkeys(("fmpy", "pythonfmu3"), "fmu"),
    "fastsim": "proof",
}
VALUES = {
    "out": "DIR",
    "recordings": "BAG",
    "held_out": "BAG",
    "simulator": "SIM",
    "record": "BAG",
}  # in help
EXTRA_OF_PROGRAM = {"deeptruck-cacc": "cacc"}  # it needs what learns too, and its extra holds that


def run(app: typer.Typer, program: str, arguments: Sequence[str] | None = None) -> None:
    """Run the commands of `app` on `arguments` (default: the command line) and exit.

    Exit codes: 0; 2 for bad input, and for a library of an extra that is not installed; 130 after Ctrl-C,
    SIGTERM or SIGHUP, with a last line that names --resume if work can be resumed; 1 for a defect. Every
    program has --version.
    """
    words = sys.argv[1:] if arguments is None else arguments
    if list(words) == ["--version"]:
        from importlib.metadata import version

        print(f"{program} {version('deeptruck')}")
        sys.exit(0)
    files.kept.clear()  # of commands that ran before in this process
    with interrupts.heeded(lambda: _last_words(program, _interrupted(app, words), INTERRUPTED)) as interrupt:
        try:
            code = _code(app, program, words)
        finally:  # with whatever a library makes of an interrupt
            if interrupt.asked:
                interrupt.end()
    if code == INTERRUPTED:  # typer makes an exit code of a KeyboardInterrupt
        _last_words(program, _interrupted(app, words), code)
    sys.exit(code)


def moved(app: typer.Typer, name: str, to: str) -> None:
    """Keep the name of a renamed command for one release: it ends with exit code 2 and states the new name.

    `help` does not list it, and it accepts the arguments that it had.
    """

    def gone() -> None:
        raise InputError(f"'{name}' moved to {to}")

    anything = {"ignore_unknown_options": True, "allow_extra_args": True, "help_option_names": []}
    app.command(name, hidden=True, context_settings=anything)(gone)


def _code(app: typer.Typer, program: str, words: Sequence[str]) -> int:
    """The exit code of a command line; bad input is printed."""
    try:
        _nothing_empty(words)
        # as a function, typer lets its errors out instead of drawing them over five lines
        code = _command(app)(words, prog_name=program, standalone_mode=False)
    except (InputError, TyperException) as error:
        if type(error).__name__ == "NoArgsIsHelpError":  # typer's, which gives it no public place
            print(error, file=sys.stderr)  # the help
            return 2
        return _last_words(program, _line(error), 2)
    except ModuleNotFoundError as error:
        library = (error.name or "").partition(".")[0]
        if library not in EXTRA_OF:
            raise
        extra = EXTRA_OF_PROGRAM.get(program, EXTRA_OF[library])
        return _last_words(program, MISSING.format(name=library, extra=extra), 2)
    except OSError as error:
        what = error.strerror or str(error)
        return _last_words(program, f"{error.filename}: {what}" if error.filename else what, 2)
    return code if isinstance(code, int) else 0


def _interrupted(app: typer.Typer, words: Sequence[str]) -> str:
    command: Any = _command(app)
    inside = getattr(command, "commands", {})
    command = next((inside[word] for word in words if word in inside), command)
    resumes = any("--resume" in parameter.opts for parameter in command.params)
    if not resumes:
        return "interrupted"
    how = "the same command with --resume goes on" if files.kept else "nothing was saved yet"
    return f"interrupted; {how}"


@cache
def _command(app: typer.Typer) -> Callable[..., object]:
    """The parser of `app`, created once per process because reading the signatures of all commands is
    slow."""
    app.rich_markup_mode = None  # help as plain text: the library that draws boxes takes longer than the help
    command = get_command(app)
    for one in (command, *getattr(command, "commands", {}).values()):
        for parameter in one.params:
            _in_capitals(parameter)
    return command


def _in_capitals(parameter: Any) -> None:
    """The placeholder for an option's value in the help: its choices, N for a count, X for a number, or a
    name."""
    annotation = getattr(getattr(parameter, "type_descriptor", None), "annotation", None)
    kinds = {annotation, *get_args(annotation)}
    choices = any(get_origin(k) is Literal or (isinstance(k, type) and issubclass(k, Enum)) for k in kinds)
    if parameter.param_type_name != "option" or parameter.metavar or parameter.is_flag or choices:
        return
    name = VALUES.get(parameter.name, parameter.name.upper().replace("_", "-"))
    parameter.metavar = "N" if int in kinds else "X" if float in kinds else name


def _nothing_empty(words: Sequence[str]) -> None:
    """Raises InputError for an option with an empty value, such as an unset shell variable: an empty path
    would be the working directory."""
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
