from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from deeptruck_core.errors import InputError
from deeptruck_model.recordings.layout import Columns, Walker

ODD = """
std_msgs/Header header
uint8 small
float64 big
bool[] flags
string text
float32[3] triple
string[] labels
geometry_msgs/Point[] points
uint16 last
"""


def store(ros1: bool) -> Any:
    types = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_JAZZY)
    types.register(get_types_from_msg(ODD, "test_msgs/msg/Odd"))
    return types


def odd_messages(types: Any, rng: np.random.Generator, count: int) -> list[Any]:
    """Messages whose texts and lists differ in length, so that no two fields stay where they are."""
    make = types.types
    messages = []
    for k in range(count):
        stamp = make["builtin_interfaces/msg/Time"](sec=k + 1, nanosec=k * 1000)
        frame = "f" * int(rng.integers(0, 9))
        extra = {"seq": k} if "seq" in dict(types.fielddefs["std_msgs/msg/Header"][1]) else {}
        points = [make["geometry_msgs/msg/Point"](*rng.normal(size=3)) for _ in range(rng.integers(0, 3))]
        messages.append(
            make["test_msgs/msg/Odd"](
                header=make["std_msgs/msg/Header"](stamp=stamp, frame_id=frame, **extra),
                small=int(rng.integers(0, 255)),
                big=float(rng.normal()),
                flags=rng.integers(0, 2, rng.integers(0, 4)).astype(bool),
                text="ü" * int(rng.integers(0, 5)),
                triple=rng.normal(size=3).astype(np.float32),
                labels=["x" * int(rng.integers(0, 3)) for _ in range(rng.integers(0, 3))],
                points=points,
                last=int(rng.integers(0, 65535)),
            )
        )
    return messages


@pytest.mark.parametrize("form", ["little endian", "big endian", "ROS 1"])
def test_columns_equal_what_rosbags_deserialises(form: str) -> None:
    ros1 = form == "ROS 1"
    types = store(ros1)
    messages = odd_messages(types, np.random.default_rng(0), 300)
    if ros1:
        raw = [bytes(types.serialize_ros1(m, m.__msgtype__)) for m in messages]
    else:
        little = form == "little endian"
        raw = [bytes(types.serialize_cdr(m, m.__msgtype__, little_endian=little)) for m in messages]
    paths = ("small", "big", "triple[1]", "points[0].y", "flags[2]", "last")
    columns = Columns(Walker(types.fielddefs, ros1=ros1), "test_msgs/msg/Odd", paths)
    sizes = np.array([len(r) for r in raw])
    buffer = np.frombuffer(b"".join(raw), np.uint8)
    stamps, values = columns.read(buffer, np.cumsum(sizes) - sizes, sizes, np.zeros(300, np.int64))
    nan = float("nan")
    expected = [
        [float(m.small) for m in messages],
        [m.big for m in messages],
        [float(m.triple[1]) for m in messages],
        [m.points[0].y if m.points else nan for m in messages],
        [float(m.flags[2]) if len(m.flags) > 2 else nan for m in messages],
        [float(m.last) for m in messages],
    ]
    np.testing.assert_array_equal(np.array(values), np.array(expected))
    np.testing.assert_array_equal(stamps, [(k + 1) * 1_000_000_000 + k * 1000 for k in range(300)])


def test_names_decide_which_value_is_whose() -> None:
    """A JointState whose names change their order, and come and go, at equal length."""
    types = get_typestore(Stores.ROS2_JAZZY)
    make = types.types
    header = make["std_msgs/msg/Header"](make["builtin_interfaces/msg/Time"](0, 0), "")
    none = np.zeros(0)
    orders = [["gear", "fuel"], ["fuel", "gear"], ["gear", "tilt"], ["gear"]]
    raw = []
    for k in range(40):
        names = orders[k % 4]
        position = np.array([float(len(name)) + 100 * k for name in names])
        message = make["sensor_msgs/msg/JointState"](header, names, position, none, none)
        raw.append(bytes(types.serialize_cdr(message, message.__msgtype__)))
    sizes = np.array([len(r) for r in raw])
    paths = ("position[name=gear]", "position[name=fuel]")
    columns = Columns(Walker(types.fielddefs), "sensor_msgs/msg/JointState", paths)
    log_ns = np.arange(40, dtype=np.int64) + 7
    buffer = np.frombuffer(b"".join(raw), np.uint8)
    stamps, (gear, fuel) = columns.read(buffer, np.cumsum(sizes) - sizes, sizes, log_ns)
    number = np.arange(40)
    np.testing.assert_array_equal(gear, 100.0 * number + 4)
    np.testing.assert_array_equal(fuel, np.where(number % 4 < 2, 100.0 * number + 4, np.nan))
    np.testing.assert_array_equal(stamps, log_ns)  # a stamp of zero is none


@pytest.mark.parametrize(
    ("msgtype", "path", "there"),
    [
        ("geometry_msgs/msg/TwistStamped", "twist.linear.x", True),
        ("geometry_msgs/msg/TwistStamped", "twist.linear", False),
        ("geometry_msgs/msg/TwistStamped", "linear.x", False),
        ("sensor_msgs/msg/JointState", "position[name=gear]", True),
        ("sensor_msgs/msg/JointState", "position[2]", True),
        ("std_msgs/msg/Float64", "data", True),
        ("std_msgs/msg/String", "data", False),
        ("no_msgs/msg/Such", "data", False),
    ],
)
def test_whether_a_field_exists(msgtype: str, path: str, there: bool) -> None:
    assert Walker(get_typestore(Stores.ROS2_JAZZY).fielddefs).has(msgtype, path) is there


@pytest.mark.parametrize("length", [0, 1, 5, 11, 12, 20])
def test_a_message_too_short_for_its_type_is_damage(length: int) -> None:
    types = get_typestore(Stores.ROS2_JAZZY)
    columns = Columns(Walker(types.fielddefs), "geometry_msgs/msg/TwistStamped", ("twist.linear.x",))
    buffer = np.frombuffer(b"\0\1\0\0" + bytes(60), np.uint8)
    with pytest.raises(InputError, match="does not fit its definition"):
        columns.read(buffer, np.array([0]), np.array([length]), np.array([0]))
