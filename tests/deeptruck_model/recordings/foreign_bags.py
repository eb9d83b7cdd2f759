"""Bags as other programs write them, message by message."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from mcap.writer import Writer as McapWriter
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionFormat, StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_typestore

from deeptruck_model.recordings.message_definitions import definition

TWIST = "geometry_msgs/msg/TwistStamped"
TYPES, ROS1 = get_typestore(Stores.ROS2_JAZZY), get_typestore(Stores.ROS1_NOETIC)
Message = tuple[str, Any, int]  # topic, message, log time in ns
S = 1_000_000_000


def stamped(ns: int, types: Any = TYPES, **extra: int) -> Any:
    time = types.types["builtin_interfaces/msg/Time"](ns // S, ns % S)
    return types.types["std_msgs/msg/Header"](stamp=time, frame_id="map", **extra)


def twist(speed: float, ns: int, types: Any = TYPES, **extra: int) -> Any:
    zero = types.types["geometry_msgs/msg/Vector3"](0.0, 0.0, 0.0)
    moving = types.types["geometry_msgs/msg/Vector3"](speed, 0.0, 0.0)
    make = types.types["geometry_msgs/msg/TwistStamped"]
    return make(stamped(ns, types, **extra), types.types["geometry_msgs/msg/Twist"](moving, zero))


def number(value: float, types: Any = TYPES) -> Any:
    return types.types["std_msgs/msg/Float64"](value)


def bag_of(path: Path, messages: Iterable[Message], **options: Any) -> Path:
    """A bag as other programs write it, of these `types`; a topic may carry several."""
    compression, types = options.pop("compression", None), options.pop("types", TYPES)
    storage = options.pop("storage", StoragePlugin.MCAP)
    writer = Writer2(path, version=9, storage_plugin=storage)
    if compression:
        writer.set_compression(compression, CompressionFormat.ZSTD)
    connections: dict[tuple[str, str], Any] = {}
    with writer:
        for topic, message, log_ns in messages:
            kind = message.__msgtype__
            if (topic, kind) not in connections:
                connections[topic, kind] = writer.add_connection(topic, kind, typestore=types)
            writer.write(connections[topic, kind], log_ns, types.serialize_cdr(message, kind))
    return path


def mcap_of(
    file: Path, messages: Iterable[Message], odd: tuple[str, str, str] | None = None, **options: Any
) -> Path:
    """Twists on /truck/twist by MCAP's own library; with a message on /odd of this name, encoding, schema."""
    with file.open("wb") as stream:
        writer = McapWriter(stream, **options)
        writer.start(profile="ros2", library="test")
        schema = writer.register_schema(TWIST, "ros2msg", definition(TWIST)[0].encode())
        twists = writer.register_channel("/truck/twist", "cdr", schema)
        for _, message, ns in messages:
            writer.add_message(twists, ns, bytes(TYPES.serialize_cdr(message, TWIST)), ns)
        if odd is not None:
            name, encoding, text = odd
            schema = writer.register_schema(name, encoding, text.encode()) if encoding else 0
            kind = "cdr" if encoding.startswith("ros2") else "json"
            writer.add_message(writer.register_channel("/odd", kind, schema), S, b"{}", S)
        writer.finish()
    return file


def ros1_of(file: Path, messages: Iterable[Message]) -> Path:
    """A ROS 1 bag of messages of ROS1 types."""
    with Writer1(file) as writer:
        topics: dict[str, Any] = {}
        for topic, message, ns in messages:
            kind = message.__msgtype__
            if topic not in topics:
                topics[topic] = writer.add_connection(topic, kind, typestore=ROS1)
            writer.write(topics[topic], ns, ROS1.serialize_ros1(message, kind))
    return file


def drive_messages(topic: str = "/truck/twist", count: int = 300) -> list[Message]:
    return [(topic, twist(0.1 * k, S + k * S // 10), S + k * S // 10) for k in range(count)]
