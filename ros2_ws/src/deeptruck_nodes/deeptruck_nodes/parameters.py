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
from deeptruck_model import checks

if TYPE_CHECKING:
    from rclpy.node import Node

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
    """Node -> parameter -> {kind, default, range or choices, says}; 'common' belongs to every node."""
    text = importlib.resources.files("deeptruck_nodes").joinpath("parameters.yaml").read_text()
    loaded: dict[str, dict[str, dict[str, Any]]] = yaml.safe_load(text)
    return loaded


def described(node: str) -> dict[str, dict[str, Any]]:
    """The parameters of one node, the common ones first."""
    return {**schema()["common"], **schema()[node]}


def checked(node: str, given: Mapping[str, Any]) -> dict[str, Any]:
    """Defaults replaced by the given values.

    Raises InputError for unknown names, wrong types and values outside their ranges, all in one message.
    """
    checks.refuse(misfits(node, given))
    return {
        name: _value(node, name, entry, given.get(name, entry["default"]))
        for name, entry in described(node).items()
    }


def misfits(node: str, given: Mapping[str, Any]) -> list[str]:
    """Errors in the values given for a node, one line each."""
    known, found = described(node), []
    for name, value in given.items():
        try:
            if name not in known:
                raise InputError(f"{node} has no parameter '{name}'; it has: {', '.join(sorted(known))}")
            _value(node, name, known[name], value)
        except InputError as error:
            found.append(str(error))
    return found


def _value(node: str, name: str, entry: Mapping[str, Any], value: Any) -> Any:
    kinds = _KINDS[entry["kind"]]
    if not isinstance(value, kinds) or (isinstance(value, bool) and bool not in kinds):
        raise InputError(f"{node}: {name} = {value!r} is not a {entry['kind']} ({entry['says']})")
    if "range" in entry:
        low, high = entry["range"]
        if not math.isfinite(value) or not low <= value <= high:
            raise InputError(f"{node}: {name} = {value} is outside {low}..{high} ({entry['says']})")
    if "choices" in entry and value not in entry["choices"]:
        raise InputError(f"{node}: {name} = '{value}' is not one of {', '.join(entry['choices'])}")
    if entry["kind"] == "number":
        return float(value)
    return list(value) if entry["kind"] == "texts" else value


def read_file(path: Path) -> dict[str, dict[str, Any]]:
    """A ROS parameter file (node: ros__parameters: name: value), checked. Raises InputError."""
    try:
        loaded = yaml.safe_load(path.read_text())
    except OSError as error:
        raise InputError(f"cannot read parameters {path}: {error.strerror}") from None
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise InputError(f"{path} is not YAML: {' '.join(str(error).split())}") from None
    if not isinstance(loaded, dict):
        raise InputError(f"{path} holds no parameters; expected 'NODE: {{ros__parameters: {{name: value}}}}'")
    return {
        str(node).lstrip("/"): _section(path, str(node).lstrip("/"), section)
        for node, section in loaded.items()
    }


def _section(path: Path, node: str, section: Any) -> dict[str, Any]:
    if node not in schema() or node == "common":
        raise InputError(
            f"{path}: there is no node '{node}'; known: {', '.join(n for n in schema() if n != 'common')}"
        )
    values = section.get("ros__parameters") if isinstance(section, dict) else None
    if not isinstance(values, dict):
        raise InputError(f"{path}: '{node}' needs 'ros__parameters:' with name: value below it")
    checked(node, values)
    return values


def write_file(path: Path, sections: Mapping[str, Mapping[str, Any]]) -> None:
    """Inverse of read_file: writes all parameters of a run to one file for `--params-file`."""
    document = {
        # rcl cannot type an empty list; the schema's default is the same.
        node: {"ros__parameters": {k: v for k, v in checked(node, values).items() if v != []}}
        for node, values in sections.items()
    }
    files.write(path, yaml.safe_dump(document, sort_keys=False).encode())


def declare(node: Node) -> dict[str, Any]:
    """Check the parameters given to the node, declare the others, and describe all to `ros2 param`."""
    from rclpy.parameter import Parameter

    name = node.get_name()
    own = {key: p.value for key, p in node.get_parameters_by_prefix("").items()}
    given = {key: value for key, value in own.items() if key not in _OF_ROS}
    values = checked(name, given)
    for key, entry in described(name).items():
        descriptor = _descriptor(key, entry)
        if key in given:
            node.set_parameters([Parameter(key, value=values[key])])
            node.set_descriptor(key, descriptor)
        else:
            node.declare_parameter(key, values[key], descriptor)
    return values


def _descriptor(name: str, entry: Mapping[str, Any]) -> Any:
    from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor

    says = entry["says"] + (f" (one of {', '.join(entry['choices'])})" if "choices" in entry else "")
    # Read-only: a node takes its parameters once, at start.
    descriptor = ParameterDescriptor(name=name, description=says, read_only=True, dynamic_typing=True)
    if "range" in entry:
        low, high = entry["range"]
        if entry["kind"] == "integer":
            descriptor.integer_range = [IntegerRange(from_value=low, to_value=high, step=1)]
        else:
            descriptor.floating_point_range = [
                FloatingPointRange(from_value=float(low), to_value=float(high))
            ]
    return descriptor
