"""Parameters, checked against the names, defaults, ranges and descriptions in parameters.yaml."""

from __future__ import annotations

import functools
import importlib.resources
import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import yaml

from deeptruck_core import files
from deeptruck_core.errors import InputError

if TYPE_CHECKING:
    from rclpy.node import Node

Sections = dict[str, dict[str, Any]]
"""Parameters by node and name."""

_KINDS: dict[str, Any] = {
    "number": (int, float),
    "integer": (int,),
    "text": (str,),
    "switch": (bool,),
    "texts": (list, tuple),
}
_OF_ROS = ("use_sim_time", "start_type_description_service")  # every rclpy node declares these itself


@functools.cache
def schema() -> dict[str, dict[str, dict[str, Any]]]:
    """Node -> parameter -> {kind, default, range, says}; 'common' belongs to every node."""
    text = importlib.resources.files("deeptruck_nodes").joinpath("parameters.yaml").read_text()
    loaded: dict[str, dict[str, dict[str, Any]]] = yaml.safe_load(text)
    return loaded


def described(node: str) -> dict[str, dict[str, Any]]:
    """The parameters of one node, the common ones first."""
    return {**schema()["common"], **schema()[node]}


def checked(node: str, given: Mapping[str, Any]) -> dict[str, Any]:
    """Defaults replaced by the given values. Raises InputError for an unknown name, a wrong type or a value
    outside its range."""
    known = described(node)
    for name in given:
        if name not in known:
            raise InputError(f"{node} has no parameter '{name}'; it has: {', '.join(sorted(known))}")
    return {
        name: _value(node, name, entry, given.get(name, entry["default"])) for name, entry in known.items()
    }


def _value(node: str, name: str, entry: Mapping[str, Any], value: Any) -> Any:
    kinds = _KINDS[entry["kind"]]
    if not isinstance(value, kinds) or (isinstance(value, bool) and bool not in kinds):
        raise InputError(f"{node}: {name} = {value!r} is not a {entry['kind']} ({entry['says']})")
    if "range" in entry:
        low, high = entry["range"]
        if not math.isfinite(value) or not low <= value <= high:
            raise InputError(f"{node}: {name} = {value} is outside {low}..{high} ({entry['says']})")
    if entry["kind"] == "number":
        return float(value)
    return list(value) if entry["kind"] == "texts" else value


def read_file(path: Path) -> Sections:
    """A ROS parameter file (node: ros__parameters: name: value), checked. Raises InputError."""
    try:
        loaded = yaml.safe_load(path.read_text())
    except OSError as error:
        raise InputError(f"cannot read parameters {path}: {error.strerror}") from None
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise InputError(f"{path} is not YAML: {' '.join(str(error).split())}") from None
    nodes = [name for name in schema() if name != "common"]
    found = {}
    for key, section in (loaded if isinstance(loaded, dict) else {"": None}).items():
        node = str(key).lstrip("/")
        values = section.get("ros__parameters") if isinstance(section, dict) else None
        if node not in nodes or not isinstance(values, dict):
            raise InputError(
                f"{path}: expected 'NODE: {{ros__parameters: {{name: value}}}}', not '{node}'; nodes are "
                f"{', '.join(nodes)}"
            )
        checked(node, values)
        found[node] = values
    return found


def write_file(path: Path, sections: Mapping[str, Mapping[str, Any]]) -> None:
    """Inverse of read_file: writes all parameters of a run to one file for `--params-file`."""
    document = {
        # rcl cannot type an empty list; the schema's default is the same.
        node: {"ros__parameters": {name: value for name, value in values.items() if value != []}}
        for node, values in sections.items()
    }
    files.write(path, yaml.safe_dump(document, sort_keys=False).encode())


def declare(node: Node) -> dict[str, Any]:
    """Check the parameters given to the node, declare the others, and describe all to `ros2 param`."""
    from rcl_interfaces.msg import ParameterDescriptor
    from rclpy.parameter import Parameter

    own = {key: p.value for key, p in node.get_parameters_by_prefix("").items()}
    given = {key: value for key, value in own.items() if key not in _OF_ROS}
    values = checked(node.get_name(), given)
    for key, entry in described(node.get_name()).items():
        # Read-only: a node takes its parameters once, at the start.
        descriptor = ParameterDescriptor(
            name=key, description=entry["says"], read_only=True, dynamic_typing=True
        )
        if key in given:
            node.set_parameters([Parameter(key, value=values[key])])
            node.set_descriptor(key, descriptor)
        else:
            node.declare_parameter(key, values[key], descriptor)
    return values
