"""package.xml and setup.py say of the nodes what is so."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
import tomllib
from pathlib import Path
from xml.etree import ElementTree

from deeptruck_nodes import parameters

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "ros2_ws" / "src" / "deeptruck_nodes"
PYPROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())
PROJECT, VERSION = PYPROJECT["project"], PYPROJECT["tool"]["setuptools_scm"]["fallback_version"]
XML = ElementTree.parse(PACKAGE / "package.xml").getroot()
OURS = {"deeptruck_core", "deeptruck_model", "deeptruck_cacc", "truck_bridge", "deeptruck_nodes"}
OF_PIP = {"numpy", "yaml", "typer", "can", "libsumo", "rosbags"}  # come with the project, which pip installs


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
