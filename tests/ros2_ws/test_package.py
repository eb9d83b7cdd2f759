"""package.xml and setup.py say of the nodes what is so."""

from __future__ import annotations

import ast
import importlib
import re
import shlex
import subprocess
import sys
import tomllib
from pathlib import Path
from xml.etree import ElementTree

import pytest
import typer
from typer.main import get_command

from deeptruck_nodes import parameters

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "ros2_ws" / "src" / "deeptruck_nodes"
PYPROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())
PROJECT, VERSION = PYPROJECT["project"], PYPROJECT["tool"]["setuptools_scm"]["fallback_version"]
XML = ElementTree.parse(PACKAGE / "package.xml").getroot()
OURS = {"deeptruck_core", "deeptruck_model", "deeptruck_cacc", "truck_bridge", "deeptruck_nodes"}
OF_PIP = {"numpy", "yaml", "typer", "can"}  # come with the project, which pip installs


def imported() -> set[str]:
    """Packages that the nodes import from outside this project, those inside functions among them."""
    names: set[str] = set()
    for path in (PACKAGE / "deeptruck_nodes").rglob("*.py"):
        for part in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(part, ast.Import):
                names |= {alias.name.partition(".")[0] for alias in part.names}
            elif isinstance(part, ast.ImportFrom) and part.module:
                names.add(part.module.partition(".")[0])
    return names - set(sys.stdlib_module_names) - OURS


def test_what_the_nodes_import_of_ros_is_declared_and_no_more() -> None:
    declared = [part.text for part in XML.iter("exec_depend")]
    assert len(declared) == len(set(declared))
    assert set(declared) == imported() - OF_PIP
    assert imported() >= OF_PIP


def test_name_version_and_licence_are_the_projects() -> None:
    said = {part.tag: part.text for part in XML}
    assert (said["version"], said["license"]) == (VERSION, PROJECT["license"])
    assert said["name"] == PACKAGE.name and (PACKAGE / "resource" / PACKAGE.name).exists()
    asked = [sys.executable, "setup.py", "--name", "--version"]
    given = subprocess.run(asked, cwd=PACKAGE, capture_output=True, text=True, check=True).stdout
    assert given.split()[-2:] == [said["name"], said["version"]]


def test_setup_makes_a_program_of_every_node() -> None:
    (listed,) = re.findall(r"^NODES = (\(.*?\))$", (PACKAGE / "setup.py").read_text(), re.M | re.S)
    assert set(ast.literal_eval(listed)) == set(parameters.schema()) - {"common"}


# The start scripts: console scripts of the package, and the same as files of the workspace


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
