"""The metadata.yaml of a rosbag2 folder (version 9, as ROS 2 Jazzy writes it), and message types."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any

import yaml
from rosbags.typesys import Stores, get_typestore

from deeptruck_core.errors import InputError

VERSION = 9


@dataclass(frozen=True)
class Topic:
    """One topic of a bag with its message type and number of messages."""

    name: str
    type_name: str  # as in 'geometry_msgs/msg/TwistStamped'
    count: int


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


def metadata_yaml(
    file_name: str, topics: list[Topic], start_ns: int, end_ns: int, custom: dict[str, str]
) -> str:
    """The text of metadata.yaml for a folder with one MCAP file."""
    count = sum(topic.count for topic in topics)
    span = {
        "starting_time": {"nanoseconds_since_epoch": start_ns},
        "duration": {"nanoseconds": max(0, end_ns - start_ns)},
        "message_count": count,
    }
    information = {
        "version": VERSION,
        "storage_identifier": "mcap",
        "relative_file_paths": [file_name],
        **span,
        "topics_with_message_count": [
            {
                "topic_metadata": {
                    "name": topic.name,
                    "type": topic.type_name,
                    "serialization_format": "cdr",
                    "offered_qos_profiles": [],
                    "type_description_hash": definition(topic.type_name)[1],
                },
                "message_count": topic.count,
            }
            for topic in topics
        ],
        "compression_format": "",
        "compression_mode": "",
        "files": [{"path": file_name, **span}],
        "custom_data": custom or None,
        "ros_distro": "jazzy",
    }
    return yaml.safe_dump({"rosbag2_bagfile_information": information}, sort_keys=False)
