"""package.xml and setup.py say of the nodes what is so."""

from __future__ import annotations

import ast
import importlib
import os
import re
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

from deeptruck_core.signals import CHANNELS, FAULTS
from deeptruck_model.recordings.topic_map import DEFAULT_TOPICS
from deeptruck_nodes import parameters
from deeptruck_nodes.topics import RECORDED, TOPICS, Topic, expected_subscribers

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


# One list of topics: layouts, bags and the running nodes keep to it


def test_a_node_starts_without_the_library_of_mechanisms() -> None:
    """The library took three quarters of the processor time in which a node starts."""
    script = "import sys, deeptruck_nodes.leader, deeptruck_nodes.live_page; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert not {"numba", "scipy.signal"} & set(done.stdout.split())


def test_extraction_reads_what_the_nodes_publish() -> None:
    for channel, source in DEFAULT_TOPICS.items():
        topic = TOPICS[source.topic]
        assert topic.name in RECORDED and channel in CHANNELS
        optional = (
            "ambient_temperature",
            "latitude",
            "longitude",
            "brake_switch",
            *FAULTS,
        )  # from the bus, where it has them
        if topic.fields and channel not in optional:
            assert source.field == f"position[name={channel}]" and channel in topic.fields


def test_expected_subscribers_count_the_nodes_of_the_run_only() -> None:
    twist = TOPICS["/truck/twist"]
    assert expected_subscribers(twist, ("leader", "controller", "recorder", "truck_sim")) == 3
    assert expected_subscribers(twist, ("controller",)) == 1


def topic_of(path: str) -> Topic:
    """The topic a path begins with."""
    found = [topic for name, topic in TOPICS.items() if re.match(rf"{re.escape(name)}(?:[./\[{{]|$)", path)]
    assert len(found) == 1, f"{path} belongs to no topic"
    return found[0]


def resolves(topic: Topic, field: str) -> bool:
    """Whether a dotted path, with [index] where it is a list, exists in the topic's message."""
    value: object = topic.message()
    for name, index in re.findall(r"(\w+)(?:\[(\d+)\])?", field):
        if not hasattr(value, name):
            return False
        value = getattr(value, name)
        if index:
            return topic.fields != () and int(index) < len(topic.fields)
    return isinstance(value, int | float)


@pytest.mark.parametrize("layout", ["foxglove.json", "plotjuggler.xml"])
def test_a_layout_shows_fields_that_exist(layout: str) -> None:
    text = (ROOT / "layouts" / layout).read_text()
    paths = set(re.findall(r'"(?:value|topicToRender)":\s*"(/[^"]+)"', text))
    paths |= set(re.findall(r'<(?:curve|topic)\b[^>]* name="([^"]+)"', text))
    assert {"/truck/twist", "/radar/range", "/truck/command"} <= {topic_of(path).name for path in paths}
    for path in paths:
        topic = topic_of(path)
        rest = path.removeprefix(topic.name).strip("./")
        by_joint = layout.endswith("xml") and topic.fields and rest  # so PlotJuggler names a JointState
        assert not rest or (
            rest.partition("/")[0] in topic.fields if by_joint else resolves(topic, rest.replace("/", "."))
        ), path
