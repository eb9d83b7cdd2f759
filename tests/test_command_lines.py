"""Command lines that are empty, wrong or half: exit code 2, one line or the help, never a traceback."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path
from typing import Any

import pytest
import typer
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import deeptruck_cacc.cli
import truck_bridge.cli
from deeptruck_core.terminal import console
from deeptruck_model import cli
from deeptruck_nodes import replay_recording, start_simulation, start_vehicle


def _alone(command: Any) -> typer.Typer:
    app = typer.Typer(add_completion=False)
    app.command()(command)
    return app


APPS = {
    "deeptruck-model": cli.whole(),
    "deeptruck-cacc": deeptruck_cacc.cli.app,
    "truck-bridge": truck_bridge.cli.app,
    "deeptruck-simulation": _alone(start_simulation.main),
    "deeptruck-vehicle": _alone(start_vehicle.main),
    "deeptruck-replay": _alone(replay_recording.main),
}
WRONG = [
    "none",
    "none.yaml",
    ".",
    "/dev/null",
    "-1",
    "nan",
    "1e999",
    "a=b",
    "truck:",
    "python:none:none",
    "☃",
]
NO_INPUT = {"deeptruck-model prove"}  # all that it needs is where to write


def commands() -> Iterator[tuple[str, tuple[str, ...], Any]]:
    """Each program's commands: program, words that name the command, what typer parses by."""
    for program, app in APPS.items():
        top: Any = console._command(app)
        inside = getattr(top, "commands", None)
        inside = inside and {name: one for name, one in inside.items() if not one.hidden}
        yield from ((program, (name,), one) for name, one in (inside or {}).items())
        if inside is None:
            yield program, (), top


COMMANDS = {" ".join((program, *words)): (program, words, one) for program, words, one in commands()}


def refused(program: str, words: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    """What is said of a command line, which is refused."""
    with pytest.raises(SystemExit) as end:
        console.run(APPS[program], program, cli.spread(words) if program == "deeptruck-model" else words)
    says = capsys.readouterr().err
    assert end.value.code == 2, (words, says)
    assert "Traceback" not in says
    return says


@pytest.mark.parametrize("program", APPS)
def test_every_program_has_a_version(program: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as end:
        console.run(APPS[program], program, ["--version"])
    assert end.value.code == 0
    assert capsys.readouterr().out == f"{program} {version('deeptruck')}\n"


@pytest.mark.parametrize("name", COMMANDS)
def test_no_arguments_and_an_unknown_option_are_one_line(
    name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    program, words, _ = COMMANDS[name]
    for more in ([], ["--no-such-option"], ["--no-such-option", "none"]):
        says = refused(program, [*words, *more], capsys)
        assert says.startswith(f"{program}: ") and says.count("\n") == 1


@pytest.mark.parametrize("name", COMMANDS)
@settings(
    max_examples=30,
    derandomize=True,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
@given(data=st.data())
def test_wrong_and_half_arguments_are_refused(
    name: str,
    data: st.DataObject,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    program, words, command = COMMANDS[name]
    value = st.sampled_from(WRONG) | st.text(
        st.characters(codec="utf-8", exclude_characters="\0"), max_size=8
    )
    line = [*words]
    needed = [p for p in command.params if p.required]
    left_out = data.draw(st.sets(st.sampled_from(needed), min_size=int(name in NO_INPUT)), "left out")
    for p in command.params:
        if (
            p in left_out
            or getattr(p, "is_eager", False)
            or (not p.required and data.draw(st.booleans(), "not given"))
        ):
            continue
        option = [p.opts[0]] if p.opts[0].startswith("-") else []
        if getattr(p, "is_flag", False):
            line += option
        else:
            line += [*option, *(data.draw(value, p.name) for _ in range(abs(p.nargs)))]
    refused(program, line, capsys)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("more", [[], ["--help"], ["minutes", "--seeds", "3", "--no-such-option"]])
@pytest.mark.parametrize(
    ("program", "name", "to"),
    [
        ("deeptruck-model", "adapt", "'mismatch' on the bag of the drive"),
        ("deeptruck-model", "road", "'import', which derives a grade"),
        ("deeptruck-model", "compare", "'Where it is off' in the report of 'mismatch'"),
        ("deeptruck-model", "experiment", "python benchmarks/paper/run.py"),
        ("deeptruck-model", "sweep", "'deeptruck-model fleet train TRUCK --seeds N'"),
        ("deeptruck-cacc", "sweep", "'deeptruck-cacc train --seeds N'"),
    ],
)
def test_a_command_that_moved_names_its_new_place_whatever_it_is_given(
    program: str, name: str, to: str, more: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    says = refused(program, [name, *more], capsys)
    assert f"{program}: '{name}' moved to {to}" in says and says.count("\n") == 1


LIGHT = """
import importlib, sys
module, heavy = sys.argv[1:]
sys.argv = [module, "--help"]
try:
    importlib.import_module(module).main()
except SystemExit as ended:
    assert not ended.code
loaded = set(heavy.split()) & set(sys.modules)
assert not loaded, loaded
"""
HEAVY = {  # what asking for help must not load
    "deeptruck_model.cli": "torch numba matplotlib",
    "deeptruck_cacc.cli": "torch numba stable_baselines3 scipy matplotlib onnx rosbags",
    "truck_bridge.cli": "torch numba scipy",
}


@pytest.mark.parametrize("module", HEAVY)
def test_help_comes_before_anything_heavy(module: str) -> None:
    command = [sys.executable, "-c", LIGHT, module, HEAVY[module]]
    done = subprocess.run(command, capture_output=True, text=True, timeout=240, check=False)
    assert done.returncode == 0, done.stderr
