"""Who may import whom, held by reading the source: the arrows of docs/architecture.md."""

from __future__ import annotations

import ast
import functools
import re
import sys
import tomllib
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
SOURCES = (ROOT / "src", ROOT / "exam" / "src", ROOT / "ros2_ws" / "src" / "deeptruck_nodes")
OURS = (
    "deeptruck_core",
    "deeptruck_model",
    "deeptruck_exam",
    "deeptruck_cacc",
    "truck_bridge",
    "deeptruck_nodes",
)
ROS = {
    "rclpy", "ament_index_python", "builtin_interfaces", "diagnostic_msgs", "geometry_msgs", "lifecycle_msgs",
    "rcl_interfaces", "rosgraph_msgs", "sensor_msgs", "std_msgs", "std_srvs",
}  # fmt: skip
IMPORT_NAMES = {
    "pyyaml": "yaml",
    "python-can": "can",
    "mcap-ros2-support": "mcap_ros2",
    "can-j1939": "j1939",
}
USED_BY_OTHERS = {  # dependencies that a dependency imports for us
    "tensorboard": "torch.utils.tensorboard",
    "msgpack": "can.interfaces.udp_multicast",
    "onnxscript": "torch.onnx",
}
OPTIONAL = {"asammdf", "fastsim"}  # said to be missing where a user wants it
TOOLS = {
    "mypy", "ruff", "pytest-timeout", "pytest-xdist", "pytest-cov", "types-pyyaml",
    "colcon-common-extensions", "build", "setuptools-scm", "twine",
}  # fmt: skip


def modules() -> dict[str, Path]:
    """Every module of ours by its dotted name."""
    found = {}
    for source in SOURCES:
        for package in OURS:
            for path in (source / package).rglob("*.py"):
                dotted = ".".join(path.relative_to(source).with_suffix("").parts)
                found[dotted.removesuffix(".__init__")] = path
    return found


MODULES = modules()


@functools.cache
def imported(path: Path) -> frozenset[str]:
    """Dotted names imported anywhere in a file; `from a import b` gives a.b if that is a module, else a."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            names = (f"{node.module}.{alias.name}" for alias in node.names)
            found |= {name if name in MODULES else str(node.module) for name in names}
    return frozenset(found)


@functools.cache
def imports() -> dict[str, frozenset[str]]:
    """What every module of ours imports; read at first need, as every worker loads this file."""
    return {name: imported(path) for name, path in MODULES.items()}


def within(name: str, *packages: str) -> bool:
    return any(name == package or name.startswith(f"{package}.") for package in packages)


@pytest.mark.parametrize(
    ("room", "closed", "door"),
    [
        ("deeptruck_core", OURS[1:], ""),
        ("deeptruck_model", ("deeptruck_cacc", "truck_bridge", "deeptruck_nodes", "can", "cantools"), ""),
        ("deeptruck_model", ("deeptruck_exam", *ROS), "deeptruck_model.cli.mismatch"),
        (
            "deeptruck_cacc",
            ("truck_bridge", "deeptruck_nodes", "deeptruck_exam", "can", "cantools", *ROS),
            "",
        ),
        ("truck_bridge", ("deeptruck_cacc", "deeptruck_nodes", "deeptruck_exam", *ROS), ""),
        ("deeptruck_nodes", ("deeptruck_exam",), ""),
        # laws are planted by other code than the one that names them
        ("deeptruck_exam", ("deeptruck_model.cli", "deeptruck_model.mismatch"), ""),
        ("deeptruck_exam", ("deeptruck_cacc", "truck_bridge"), ""),
    ],
)
def test_doors_that_are_closed(room: str, closed: tuple[str, ...], door: str) -> None:
    rooms = [name for name in MODULES if within(name, room)]
    assert len(rooms) > 3
    found = {(name, other) for name in rooms for other in imports()[name] if within(other, *closed)}
    assert {name for name, _ in found} == ({door} if door else set())


def test_the_safety_core_stands_alone() -> None:
    rooms = [name for name in MODULES if within(name, "truck_bridge.safety")]
    assert len(rooms) > 3
    foreign = {
        (name, other)
        for name in rooms
        for other in imports()[name]
        if not within(other, "truck_bridge.safety") and other.partition(".")[0] not in sys.stdlib_module_names
    }
    assert not foreign


FLOOR = tuple(
    f"deeptruck_model.{name}"
    for name in (
        "calls", "results", "manifest",
        "recordings.tables.table", "recordings.tables.table_file", "recordings.tables.csv_text",
        "recordings.tables.column",
        "recordings.words", "recordings.units", "recordings.ranges",
        "recordings.consistency.impossible", "recordings.interpolate",
        "outside.reference", "outside.saved", "outside.truck",
    )
)  # fmt: skip


def test_nobody_imports_what_is_private_elsewhere() -> None:
    foreign = {
        (name, other)
        for name in MODULES
        for other in imports()[name]
        if within(other, *OURS) and other.partition(".")[0] != name.partition(".")[0]
    }
    assert not {(n, o) for n, o in foreign if any(part.startswith("_") for part in o.split("."))}


def test_the_emulator_is_the_only_window_between_bridge_and_model() -> None:
    through = {
        name: {o for o in imports()[name] if within(o, "deeptruck_model") and not within(o, *FLOOR)}
        for name in MODULES
        if within(name, "truck_bridge")
    }
    assert all(within(name, "truck_bridge.emulator") for name, others in through.items() if others)
    assert set().union(*through.values()) == {
        "deeptruck_model.simulators",
        "deeptruck_model.trucks.accelerometer",
    }


def test_the_floor_imports_no_room() -> None:
    floor = ("deeptruck_core", *FLOOR)
    above = {
        (name, other)
        for name in MODULES
        for other in imports()[name]
        if within(name, *floor) and within(other, *OURS) and not within(other, *floor)
    }
    assert not above


MODEL = (  # the rooms of docs/architecture.md: a row imports from itself and the rows above
    ("simulators",),
    ("recordings",),
    ("trucks",),
    ("simulator_facts",),
    ("deep", "fmu", "mismatch"),
    ("fleet",),
    ("cli",),
)
MISMATCH = (  # the rooms of docs/architecture.md, each of which makes one value of what is above it
    ("mismatch.rules", "mismatch.folders"),
    ("mismatch.prepare",),
    ("mismatch.residual",),
    ("mismatch.expression",),
    ("mismatch.mechanisms",),
    ("mismatch.posterior",),
    ("mismatch.correction",),
    ("mismatch.verdict",),
    ("mismatch.report",),
    ("mismatch.find", "mismatch.output"),
)


@pytest.mark.parametrize("rows", [MODEL, MISMATCH], ids=["model", "mismatch"])
def test_rooms_import_forward(rows: tuple[tuple[str, ...], ...]) -> None:
    """No module imports from a row further down; of two rooms that fit it, the longer name is its room."""
    row_of = {f"deeptruck_model.{room}": at for at, row in enumerate(rows) for room in row}

    def row(name: str) -> int | None:
        rooms = [room for room in row_of if within(name, room)]
        return row_of[max(rooms, key=len)] if rooms else None

    placed = {name: at for name in MODULES if (at := row(name)) is not None}
    assert len(set(placed.values())) == len(rows)
    assert not {(name, o) for name in placed for o in imports()[name] if placed.get(o, -1) > placed[name]}


def test_no_modules_import_each_other_in_a_circle() -> None:
    """Also not inside a function or for types alone: each module can be read with those below it only."""
    graph = {name: imports()[name] & MODULES.keys() - {name} for name in MODULES}
    TopologicalSorter(graph).prepare()  # raises CycleError, which names the modules of a circle


def third_party(*roots: Path) -> set[str]:
    """Top-level packages that are neither ours nor Python's."""
    local = {path.stem for root in roots for path in root.rglob("*.py")} | {"examples", "tests", "benchmarks"}
    names = {
        name.partition(".")[0] for root in roots for path in root.rglob("*.py") for name in imported(path)
    }
    return names - set(sys.stdlib_module_names) - set(OURS) - local


def distributions(requirements: list[str]) -> set[str]:
    return {re.split(r"[\[=<>~! ]", requirement)[0].lower() for requirement in requirements}


def project() -> tuple[set[str], dict[str, set[str]]]:
    """Required distributions, and those of each extra."""
    table = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    extras = {
        name: distributions(listed) - {"deeptruck", "deeptruck-exam"}
        for name, listed in table["optional-dependencies"].items()
    }
    return distributions(table["dependencies"]), extras


def import_name(distribution: str) -> str:
    return IMPORT_NAMES.get(distribution, distribution.replace("-", "_"))


def test_what_the_source_imports_is_declared_and_what_is_declared_is_imported() -> None:
    required, extras = project()
    used = third_party(*SOURCES) - ROS - OPTIONAL - {"setuptools"}  # of colcon's setup.py
    required = required.union(*(extras[name] for name in ("deep", "cacc", "can")))
    declared = {import_name(d) for d in required | extras["ray"] | extras["dev"]}
    assert not used - declared
    everywhere = third_party(*SOURCES, ROOT / "tests", ROOT / "benchmarks", ROOT / "examples")
    idle = {d for d in required if import_name(d) not in used and d not in USED_BY_OTHERS}
    idle |= {d for d in extras["dev"] - TOOLS if import_name(d) not in everywhere}
    assert not idle
