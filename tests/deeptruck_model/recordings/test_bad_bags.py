"""Bags and topic maps that cannot be used: one line that says why."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from foreign_bags import TYPES, S, bag_of, drive_messages, stamped, twist
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2

from deeptruck_core.errors import InputError
from deeptruck_core.signals import TruckInterface
from deeptruck_model.recordings import read


def refused(path: Path, match: str, **options: Any) -> None:
    with pytest.raises(InputError, match=match) as caught:
        read(path, **options)
    assert "\n" not in str(caught.value)


def test_time_going_back_is_refused(tmp_path: Path) -> None:
    back = [
        (t, twist(1.0, ns - 100 * S if k > 200 else ns), ns) for k, (t, _, ns) in enumerate(drive_messages())
    ]
    back = [("/truck/twist", m.__class__(m.header, m.twist), ns + 200 * S) for _, m, ns in back]
    refused(bag_of(tmp_path / "bag", back), r"time goes back by \S+ s on /truck/twist")


def test_what_is_missing_is_named(tmp_path: Path) -> None:
    bag = bag_of(tmp_path / "bag", drive_messages("/other"))
    refused(bag, "no topic /truck/twist for 'speed' .topics there: /other")
    field = {"speed": {"topic": "/other", "field": "twist.speed"}}
    refused(bag, "has no field 'twist.speed'", topic_map=field)
    absent = {
        "speed": {"topic": "/other", "field": "twist.linear.x"},
        "gap": {"topic": "/no", "field": "data"},
    }
    refused(bag, "no topic /no for 'gap'", topic_map=absent)
    refused(tmp_path / "nowhere", "does not exist")
    refused(bag, "cannot be read", topic_map=tmp_path / "nowhere.yaml")


@pytest.mark.parametrize(
    ("topic_map", "match"),
    [
        ({"gap": {"topic": "/g", "field": "data"}}, "'speed' is missing; a recording needs"),
        ({"velocity": {"topic": "/g", "field": "data"}}, "topic map: unknown key 'velocity'"),
        ({"speed": {"topic": "/g"}}, "needs topic and field"),
        ({"speed": "/g"}, "needs topic and field"),
        ({"speed": {"topic": "/g", "field": "x", "unit": "rpm"}}, "'rpm' does not fit; use one of: m/s"),
        ({"speed": {"topic": "/g", "field": "x", "factor": 2}}, "speed: unknown key 'factor'"),
        ({"speed": {"topic": "/g", "field": "x", "scale": "two"}}, "scale: 'two' is not of type 'number'"),
    ],
)
def test_bad_topic_maps(tmp_path: Path, topic_map: dict[str, Any], match: str) -> None:
    refused(bag_of(tmp_path / "bag", drive_messages("/g", 3)), match, topic_map=topic_map)


def test_a_command_of_unknown_unit_is_refused(tmp_path: Path) -> None:
    make = TYPES.types["sensor_msgs/msg/JointState"]
    none = np.zeros(0)
    commands = [
        ("/truck/command", make(stamped(ns), ["engine_command"], np.array([50.0]), none, none), ns)
        for _, _, ns in drive_messages()
    ]
    bag = bag_of(tmp_path / "bag", [*drive_messages(), *commands])
    refused(bag, "in which unit its engine_command is")
    assert read(bag, interface=TruckInterface("mine"))[0].interface.name == "mine"


def test_a_bag_without_messages(tmp_path: Path) -> None:
    with Writer2(tmp_path / "bag", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        writer.add_connection("/truck/twist", "geometry_msgs/msg/TwistStamped", typestore=TYPES)
    refused(tmp_path / "bag", "is empty, it holds no message; record while .* 'ros2 bag record -a'")


def test_a_bag_of_all_but_the_speed(tmp_path: Path) -> None:
    brake = TYPES.types["std_msgs/msg/Float64"](1.0)
    with Writer2(tmp_path / "bag", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        writer.add_connection("/truck/twist", "geometry_msgs/msg/TwistStamped", typestore=TYPES)
        other = writer.add_connection("/brake", "std_msgs/msg/Float64", typestore=TYPES)
        writer.write(other, 1, TYPES.serialize_cdr(brake, "std_msgs/msg/Float64"))
    refused(tmp_path / "bag", "no speed on /truck/twist, only other messages; .*'ros2 topic hz'")
