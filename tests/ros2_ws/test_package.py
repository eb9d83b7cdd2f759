"""package.xml and setup.py say of the nodes what is so."""

from __future__ import annotations

import ast
import importlib
import os
import shlex
import shutil
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
def test_the_examples_of_the_help_are_understood(program: str) -> None:
    module = importlib.import_module(f"deeptruck_nodes.{STARTS[program]}")
    app = typer.Typer()
    app.command()(module.main)
    lines = module.EXAMPLES.replace("\n  --", " --").splitlines()
    calls = [shlex.split(line) for line in lines if line.strip().startswith(program)]
    assert len(calls) >= 2
    for _, *words in calls:
        get_command(app).make_context(program, words)


# The same package as a ROS 2 workspace


COLCON = Path(sys.executable).with_name("colcon")


@pytest.mark.skipif(not COLCON.exists(), reason="colcon is not installed in this environment")
def test_colcon_builds_nodes_that_run(tmp_path: Path) -> None:
    hidden = shutil.ignore_patterns("__pycache__", "*.egg-info", "build")
    shutil.copytree(PACKAGE, tmp_path / "src" / "deeptruck_nodes", ignore=hidden)
    build = subprocess.run(
        [COLCON, "build"], cwd=tmp_path, capture_output=True, text=True, timeout=240, check=False
    )
    assert build.returncode == 0, build.stderr
    nodes = tmp_path / "install" / "deeptruck_nodes" / "lib" / "deeptruck_nodes"
    assert {node.name for node in nodes.iterdir()} == set(parameters.schema()) - {"common"}
    # Sourced, the installed copy is the one that runs; a bad parameter makes it say its name and end.
    where = f"import deeptruck_nodes as d; assert d.__file__.startswith('{tmp_path}'), d.__file__"
    leader = f"{nodes}/leader --ros-args -p profile:=none"
    script = f'. install/setup.sh && {sys.executable} -c "{where}" && exec {leader}'
    environment = {**os.environ, "ROS_LOG_DIR": str(tmp_path)}
    run = subprocess.run(
        ["sh", "-c", script],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        text=True,
        timeout=240,
        check=False,
    )
    assert (run.returncode, run.stderr.count("\n")) == (2, 1), run.stderr
    assert "leader 'none': there is no 'none'" in run.stderr
