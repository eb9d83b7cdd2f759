"""A map proposed for bags of unknown topics: read back at once where it is complete, open where it is not."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from foreign_bags import TYPES, Message, S, bag_of, number, stamped, twist
from rosbags.rosbag2 import StoragePlugin
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from deeptruck_core.errors import InputError
from deeptruck_core.signals import TruckInterface
from deeptruck_model.recordings import Recording, read, suggest, write_bag
from deeptruck_model.recordings.suggestion import Suggestion
from deeptruck_model.recordings.survey import Field
from deeptruck_model.recordings.words import words

COUNT = 100
SPEED = 10.0 + 0.1 * np.arange(COUNT)
THROTTLE = np.arange(COUNT) / COUNT


def made(kind: str, *values: Any) -> Any:
    return TYPES.types[kind](*values)


def odometry(speed: float, ns: int) -> Any:
    pose = (
        made("geometry_msgs/msg/Point", 0.0, 0.0, 0.0),
        made("geometry_msgs/msg/Quaternion", 0.0, 0.0, 0.0, 1.0),
    )
    still = made("geometry_msgs/msg/PoseWithCovariance", made("geometry_msgs/msg/Pose", *pose), np.zeros(36))
    moving = made("geometry_msgs/msg/TwistWithCovariance", twist(speed, ns).twist, np.zeros(36))
    return made("nav_msgs/msg/Odometry", stamped(ns), "base_link", still, moving)


def lidar(x_m: float, ns: int) -> Any:
    """An odometry whose twist was never filled."""
    message = odometry(0.0, ns)
    message.pose.pose.position.x = x_m
    return message


def pedals(k: int, ns: int) -> Any:
    names, values = ["throttle", "BrakePedal"], np.array([THROTTLE[k], 0.2])
    return made("sensor_msgs/msg/JointState", stamped(ns), names, values, np.zeros(0), np.zeros(0))


def every(topic: str, message: Any, hz: int = 10) -> list[Message]:
    """`message(k, ns)` on a topic, ten seconds long."""
    times = [S + k * S // hz for k in range(COUNT * hz // 10)]
    return [(topic, message(k, ns), ns) for k, ns in enumerate(times)]


ODOMETRY = every("/odom", lambda k, ns: odometry(SPEED[k], ns))
PEDALS = every("/pedals", pedals)


def proposed(tmp_path: Path, *messages: list[Message], **options: Any) -> tuple[Path, Suggestion]:
    together = sorted((one for several in messages for one in several), key=lambda m: m[2])
    bag = bag_of(tmp_path / "bag", together, **options)
    return bag, suggest(bag)


def fields(found: Suggestion, channel: str) -> list[tuple[str, str, str]]:
    return [(one.topic.name, one.field.path, one.unit) for one in found.candidates.get(channel, [])]


@pytest.mark.parametrize("storage", [StoragePlugin.MCAP, StoragePlugin.SQLITE3])
def test_a_complete_map_is_used_as_it_is(tmp_path: Path, storage: StoragePlugin) -> None:
    bag, found = proposed(tmp_path, ODOMETRY, PEDALS, storage=storage)
    (tmp_path / "topics.yaml").write_text(found.text())
    (recording,) = read(bag, topic_map=tmp_path / "topics.yaml")
    np.testing.assert_allclose(recording.channels["speed"], SPEED)
    np.testing.assert_allclose(recording.channels["engine_command"], 100.0 * THROTTLE)
    np.testing.assert_allclose(recording.channels["brake_command"], 20.0)
    assert (recording.interface.engine_unit, recording.interface.brake_unit) == ("percent", "percent")
    assert not found.lacking


def test_fields_have_their_range_and_rate(tmp_path: Path) -> None:
    _, found = proposed(tmp_path, ODOMETRY, every("/a", lambda k, ns: number(np.nan if k else 3.0), hz=50))
    by_name = {topic.name: topic for topic in found.survey.topics}
    assert by_name["/a"].rate_hz == pytest.approx(50.0) and by_name["/a"].messages == 500
    assert by_name["/a"].fields == [Field("data", 3.0, 3.0)]
    ranges = {one.path: (one.low, one.high) for one in by_name["/odom"].fields}
    assert ranges["twist.twist.linear.x"] == (SPEED.min(), SPEED.max())
    assert not any("covariance" in path or "stamp" in path for path in ranges)


def test_of_two_candidates_the_other_is_there_but_not_read(tmp_path: Path) -> None:
    wheel = every("/wheel/speed_kmh", lambda k, ns: number(3.6 * SPEED[k // 5]), hz=50)
    bag, found = proposed(tmp_path, ODOMETRY, PEDALS, wheel)
    assert fields(found, "speed") == [
        ("/odom", "twist.twist.linear.x", "m/s"),
        ("/wheel/speed_kmh", "data", "km/h"),
    ]
    text = found.text()
    other = "speed: {topic: /wheel/speed_kmh, field: data, unit: km/h}"
    assert "2 candidates" in text and f"\n# {other}" in text
    taken = "speed: {topic: /odom, field: twist.twist.linear.x, unit: m/s}"
    (tmp_path / "topics.yaml").write_text(text.replace(f"\n{taken}", "").replace(f"# {other}", other))
    (recording,) = read(bag, topic_map=tmp_path / "topics.yaml")
    assert recording.channels["speed"][0] == pytest.approx(SPEED[0])


def test_what_was_not_found_is_said(tmp_path: Path) -> None:
    _, found = proposed(tmp_path, ODOMETRY, every("/fuel", lambda k, ns: number(20.0)))
    assert [line.split()[0] for line in found.lacking] == ["engine_command", "brake_command"]
    text = found.text()
    assert "# engine_command: engine command; negative retards. NOT FOUND" in text
    assert "the orientation in /odom is a quaternion" in text
    assert set(yaml.safe_load(text)) == {"speed"}, "a fuel rate without a unit is not read"


def test_a_command_of_unknown_unit_is_left_open(tmp_path: Path) -> None:
    _, found = proposed(tmp_path, ODOMETRY, every("/brake", lambda k, ns: number(k / 10)))
    assert "say in which unit it is" in " ".join(found.lacking)
    assert '# brake_command: {topic: /brake, field: data, unit: "?"}' in found.text()


@pytest.mark.parametrize(
    ("topic", "value", "channel", "unit"),
    [
        ("/throttle", 0.9, "engine_command", "ratio"),
        ("/throttle", 90.0, "engine_command", "percent"),
        ("/torque_request", 1500.0, "engine_command", "N m"),
        ("/brake_pressure", 8.0, "brake_command", "bar"),
        ("/brake_pressure", 800.0, "brake_command", "kPa"),
        ("/brake", 60.0, "brake_command", "percent"),
        ("/vehicleSpeed", 80.0, "speed", "km/h"),
        ("/lead_speed", 20.0, "leader_speed", "m/s"),
        ("/road/pitch", 0.05, "grade", "rad"),
        ("/road/slope_percent", 5.0, "grade", "percent"),
        ("/engine_speed", 1500.0, "engine_speed", "rpm"),
        ("/outside_temperature", 290.0, "ambient_temperature", "K"),
        ("/fuel_rate_lph", 20.0, "fuel_rate", "l/h"),
        ("/speed_limit", 20.0, "", ""),
        ("/cruise/target_speed", 20.0, "", ""),
        ("/brake_temperature", 200.0, "", ""),
        ("/battery", 0.9, "", ""),
    ],
)
def test_by_words_and_range(tmp_path: Path, topic: str, value: float, channel: str, unit: str) -> None:
    _, found = proposed(tmp_path, every(topic, lambda k, ns: number(value * k / COUNT + 0.01 * value)))
    assert {name: several[0].unit for name, several in found.candidates.items()} == (
        {channel: unit} if channel else {}
    )


@pytest.mark.parametrize(
    ("topic", "channel"), [("/truck/vel", "speed"), ("/radar/twist", "leader_speed"), ("/cmd_vel", "")]
)
def test_the_same_type_means_what_its_topic_says(tmp_path: Path, topic: str, channel: str) -> None:
    _, found = proposed(tmp_path, every(topic, lambda k, ns: twist(SPEED[k], ns)))
    assert set(found.candidates) == ({channel} if channel else set())
    assert bool(found.commanded) == (not channel)


def test_positions_and_accelerations_of_sensors(tmp_path: Path) -> None:
    zero = made("geometry_msgs/msg/Vector3", 0.0, 0.0, 9.8)
    turned = made("geometry_msgs/msg/Quaternion", 0.0, 0.0, 0.0, 1.0)
    status = made("sensor_msgs/msg/NavSatStatus", 0, 1)
    imu = every(
        "/imu",
        lambda k, ns: made("sensor_msgs/msg/Imu", stamped(ns), turned, *[np.zeros(9), zero] * 2, np.zeros(9)),
    )
    fix = every(
        "/gps",
        lambda k, ns: made(
            "sensor_msgs/msg/NavSatFix", stamped(ns), status, 48.0, 11.0, 500.0, np.zeros(9), 0
        ),
    )
    _, found = proposed(tmp_path, imu, fix)
    assert fields(found, "specific_force") == [("/imu", "linear_acceleration.x", "m/s^2")]
    assert fields(found, "elevation") == [("/gps", "altitude", "m")]
    assert fields(found, "latitude") == [("/gps", "latitude", "deg")]
    assert "speed" not in found.candidates and "without it there is no recording" in found.lacking[0]


@pytest.mark.parametrize("storage", [StoragePlugin.MCAP, StoragePlugin.SQLITE3])
def test_a_type_that_only_the_bag_defines(tmp_path: Path, storage: StoragePlugin) -> None:
    types = get_typestore(Stores.ROS2_JAZZY)
    kind = "my_msgs/msg/Vehicle"
    types.register(
        get_types_from_msg("float32 velocity_mps\nfloat32[3] brakePressure_bar\nstring note", kind)
    )
    messages = every(
        "/vehicle",
        lambda k, _: types.types[kind](k / 10, np.full(3, k / 10, np.float32), "a" * (k % 5)),
    )
    found = suggest(bag_of(tmp_path / "bag", messages, storage=storage, types=types))
    assert fields(found, "speed") == [("/vehicle", "velocity_mps", "m/s")]
    assert fields(found, "brake_command") == [
        ("/vehicle", f"brakePressure_bar[{k}]", "bar") for k in range(3)
    ]
    (tmp_path / "topics.yaml").write_text(found.text())
    (recording,) = read(tmp_path / "bag", topic_map=tmp_path / "topics.yaml")
    assert recording.channels["brake_command"][-1] == pytest.approx((COUNT - 1) / 10)


def test_a_unit_that_the_values_do_not_fit_is_said(tmp_path: Path) -> None:
    _, found = proposed(tmp_path, every("/speed_mps", lambda k, ns: number(0.9 * k)))
    assert (
        "/speed_mps, data needs another source" in found.lacking[0] and "outside -1..60" in found.lacking[0]
    )


def test_long_messages_are_listed_only(tmp_path: Path) -> None:
    image = made("sensor_msgs/msg/CompressedImage", stamped(S), "png", np.zeros(5000, np.uint8))
    _, found = proposed(tmp_path, ODOMETRY, [("/camera", image, S)])
    camera = next(topic for topic in found.survey.topics if topic.name == "/camera")
    assert "longer than 4096 bytes" in camera.why and not camera.fields


def test_names_that_mean_something_in_yaml(tmp_path: Path) -> None:
    names = ["throttle: {", "brake #1", "a.brake", "a]brake", "line\nbrake"]
    state = made("sensor_msgs/msg/JointState", stamped(S), names, np.full(5, 0.5), np.zeros(0), np.zeros(0))
    _, found = proposed(tmp_path, ODOMETRY, [("/pedals", state, S)])
    read_back = yaml.safe_load(found.text())
    assert read_back["engine_command"]["field"] == "position[name=throttle: {]"
    assert [path for _, path, _ in fields(found, "brake_command")] == [
        "position[name=a.brake]",
        "position[name=brake #1]",
    ]


def test_a_bag_of_ours_comes_back_as_it_was(
    tmp_path: Path, drive: Recording, interface: TruckInterface
) -> None:
    bag = write_bag(tmp_path / "bag", [drive], interface=interface)
    (tmp_path / "topics.yaml").write_text(suggest(bag).text())
    (ours,), (mapped,) = read(bag), read(bag, topic_map=tmp_path / "topics.yaml")
    assert mapped.interface == ours.interface
    for name in ("speed", "acceleration", "engine_command", "brake_command", "grade"):
        np.testing.assert_allclose(mapped.channels[name], ours.channels[name])


def test_a_twist_that_was_never_filled_is_no_speed(tmp_path: Path) -> None:
    moved = np.cumsum(SPEED) / 10
    bag, found = proposed(tmp_path, every("/odom", lambda k, ns: lidar(moved[k], ns)), PEDALS)
    assert "speed" not in yaml.safe_load(found.text())
    assert any("twist.twist.linear.x needs another source" in line for line in found.lacking)
    with pytest.raises(InputError, match="100 are zero while positions move on"):
        read(bag, topic_map={"speed": {"topic": "/odom", "field": "twist.twist.linear.x"}})


def test_words_of_names() -> None:
    assert words("/vehicle/BrakeCmd_2") == {"vehicle", "brake", "cmd"}
    assert words("engineRPM") == {"engine", "rpm"}
