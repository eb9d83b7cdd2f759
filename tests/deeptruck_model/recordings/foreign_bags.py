"""Bags as other programs write them, message by message."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from rosbags.rosbag2 import CompressionFormat, StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_typestore

TYPES = get_typestore(Stores.ROS2_JAZZY)
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


def number(value: float) -> Any:
    return TYPES.types["std_msgs/msg/Float64"](value)


def bag_of(path: Path, messages: Iterable[Message], **options: Any) -> Path:
    """A bag as other programs write it."""
    compression = options.pop("compression", None)
    storage = options.pop("storage", StoragePlugin.MCAP)
    writer = Writer2(path, version=9, storage_plugin=storage)
    if compression:
        writer.set_compression(compression, CompressionFormat.ZSTD)
    connections: dict[str, Any] = {}
    with writer:
        for topic, message, log_ns in messages:
            kind = message.__msgtype__
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=TYPES)
            writer.write(connections[topic], log_ns, TYPES.serialize_cdr(message, kind))
    return path


def drive_messages(topic: str = "/truck/twist", count: int = 300) -> list[Message]:
    return [(topic, twist(0.1 * k, S + k * S // 10), S + k * S // 10) for k in range(count)]
