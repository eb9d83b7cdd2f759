"""Message definitions from bags and .msg files. Each is parsed separately: an error affects only its own
topics.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore

from deeptruck_core import reading
from deeptruck_core.errors import InputError

if TYPE_CHECKING:
    from deeptruck_model.recordings.bag_storage import Connection

_RULE = "=" * 80 + "\n"  # between the definitions of several types in one text
_CURE = "give the .msg files of the messages"

Types = dict[str, Any]


@cache
def definition(type_name: str) -> tuple[str, str]:
    """Message definition and RIHS01 hash of a ROS 2 Jazzy type. Raises InputError for an unknown type."""
    store = typestore()
    if type_name not in store.fielddefs:
        raise InputError(f"message type {type_name} is not one of ROS 2 Jazzy's common interfaces")
    return store.generate_msgdef(type_name, ros_version=2)[0], store.hash_rihs01(type_name)


@cache
def typestore() -> Any:
    """The message types of ROS 2 Jazzy."""
    return get_typestore(Stores.ROS2_JAZZY)


class Definitions:
    """The fields of the types of a bag: by its own definitions, then by `files` (.msg), then by ROS 2 Jazzy.

    `types` holds the readable types, as in rosbags' typestore; `unreadable` gives the reason for each other
    type.
    """

    def __init__(self, connections: Iterable[Connection], files: Iterable[Path] = (), *, ros1: bool) -> None:
        self.types: Types = {}
        self.unreadable: dict[str, str] = {}
        wanted = {c.msgtype: c for c in connections}
        for name, connection in wanted.items():
            try:
                self.types |= _parsed(connection)
            except Exception as error:  # the parsers raise whatever a text leads them to
                self.unreadable[name] = reading.why(error, 120)
        common = typestore().fielddefs
        if not ros1:
            empty = common["std_msgs/msg/Empty"][1]  # CDR has no structure without members
            self.types = {name: (one[0], one[1] or empty) for name, one in self.types.items()}
        left = list(files)
        while left:  # what a message is made of is known once that message is
            missing = {*wanted, *self._lacking()} - {*self.types}
            file = next((f for f in left if f.stem in {_stem(name) for name in missing}), left[0])
            self.types = _of_file(file, missing) | self.types
            left.remove(file)
        for name in {} if ros1 else common:
            self.types.setdefault(name, common[name])
        self.types.setdefault("builtin_interfaces/msg/Time", common["builtin_interfaces/msg/Time"])
        self.types.setdefault("builtin_interfaces/msg/Duration", common["builtin_interfaces/msg/Duration"])
        for name in wanted:
            if name in self.types:
                self.unreadable.pop(name, None)
                if lacking := sorted(self._lacking([name])):
                    self.unreadable[name] = f"the definition of {', '.join(lacking)} is missing"
                    del self.types[name]

    def _lacking(self, names: Iterable[str] | None = None) -> set[str]:
        """Missing types among these and their nested types (None: all)."""
        lacking, seen, left = set(), set(), list(self.types if names is None else names)
        while left:
            name = left.pop()
            if name not in self.types:
                lacking.add(name)
            elif name not in seen:
                seen.add(name)
                left += [inner for _, kind in self.types[name][1] if (inner := _inner(kind))]
        return lacking


def _inner(kind: Any) -> str:
    """The element type of a field; '' for a number or text."""
    node, detail = kind
    if node.name in ("ARRAY", "SEQUENCE"):
        node, detail = detail[0]
    return str(detail) if node.name == "NAME" else ""


def _stem(name: str) -> str:
    return name.rpartition("/")[2]


def _parsed(connection: Connection) -> Types:
    text = connection.definition
    if connection.language == "msg":
        return get_types_from_msg(text, connection.msgtype)
    if connection.language == "idl":
        found: Types = {}
        for part in text.split(_RULE)[1:] if text.startswith(f"{_RULE}IDL: ") else ["\n" + text]:
            found |= get_types_from_idl(part.partition("\n")[2])
        return found
    if connection.language:
        raise ValueError(f"its definition is written in {connection.language}")
    return {}


def _of_file(file: Path, wanted: set[str]) -> Types:
    """The type in a .msg file: by its path PACKAGE/msg/NAME.msg, else the requested type with that name."""
    text = reading.text(file, _CURE)
    names = [name for name in wanted if _stem(name) == file.stem]
    package = file.resolve().parent.parent.name if file.resolve().parent.name == "msg" else ""
    name = names[0] if len(names) == 1 else f"{package or 'unknown'}/msg/{file.stem}"
    if package and f"{package}/msg/{file.stem}" in names:
        name = f"{package}/msg/{file.stem}"
    elif len(names) > 1:
        raise InputError(f"{file} may be {' or '.join(sorted(names))}; put it into a folder PACKAGE/msg")
    try:
        return get_types_from_msg(text, name)
    except Exception as error:  # as above
        raise InputError(
            f"{file} is no message definition ({reading.plain(str(error), 120)}); {_CURE}"
        ) from None
