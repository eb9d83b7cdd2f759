"""The start scripts: console scripts of the package, and the same as files of the workspace."""

from __future__ import annotations

import importlib
import shlex
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
import typer
from typer.main import get_command

ROOT = Path(__file__).parents[2]
SCRIPTS = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["scripts"]
STARTS = {
    "deeptruck-simulation": "start_simulation",
    "deeptruck-vehicle": "start_vehicle",
    "deeptruck-replay": "replay_recording",
}


def test_every_start_script_is_a_console_script() -> None:
    declared = {name: target for name, target in SCRIPTS.items() if target.startswith("deeptruck_nodes.")}
    assert declared == {program: f"deeptruck_nodes.{name}:start" for program, name in STARTS.items()}
    assert {path.stem for path in (ROOT / "ros2_ws").glob("*.py")} == set(STARTS.values())


@pytest.mark.parametrize("program", STARTS)
def test_both_say_the_same(program: str, capsys: pytest.CaptureFixture[str]) -> None:
    script = [sys.executable, str(ROOT / "ros2_ws" / f"{STARTS[program]}.py"), "--help"]
    of_script = subprocess.run(script, capture_output=True, text=True, check=True, timeout=240).stdout
    with pytest.MonkeyPatch.context() as patch, pytest.raises(SystemExit) as ended:
        patch.setattr(sys, "argv", [program, "--help"])
        importlib.import_module(f"deeptruck_nodes.{STARTS[program]}").start()
    assert not ended.value.code
    says = capsys.readouterr().out
    assert f"Usage: {program} [OPTIONS]" in says and "Examples:" in says
    assert says.split("\n", 2)[2] == of_script.split("\n", 2)[2]


@pytest.mark.parametrize("program", STARTS)
def test_the_examples_of_the_help_are_understood(program: str) -> None:
    module = importlib.import_module(f"deeptruck_nodes.{STARTS[program]}")
    app = typer.Typer()
    app.command()(module.main)
    lines = module.EXAMPLES.replace("\n  --", " --").splitlines()
    calls = [shlex.split(line) for line in lines if line.strip().startswith(program)]
    assert len(calls) >= 2
    for _, *words in calls:
        get_command(app).make_context(program, words)
