"""A map proposed for bags of unknown topics: which field is which channel, in which unit, what is a command
and no measurement, and that what is proposed is read as it stands.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from foreign_bags import S, bag_of
from rosbags.rosbag2 import StoragePlugin
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from deeptruck_core.errors import InputError
from deeptruck_core.signals import CHANNELS, TruckInterface
from deeptruck_model.recordings import Recording, read, suggest, write_bag
from deeptruck_model.recordings.candidates import DEMANDS
from deeptruck_model.recordings.message_types import MESSAGE_TYPES, Role
from deeptruck_model.recordings.suggestion import Suggestion
from deeptruck_model.recordings.survey import Field
from deeptruck_model.recordings.units import conversion
from deeptruck_model.recordings.words import STATISTIC, UNIT_WORDS, words

COUNT = 100
RAMP = np.linspace(10.0, 20.0, COUNT)
PRESSED = np.linspace(0.15, 0.5, COUNT)
Values = dict[str, Any]  # by path, one or a series; a number that is not named is 0
Topics = Mapping[str, tuple[str, Values]]

TYPES = {
    "autoware_vehicle_msgs/msg/VelocityReport": "float32 longitudinal_velocity\nfloat32 lateral_velocity",
    "autoware_vehicle_msgs/msg/GearReport": "uint8 report",
    "autoware_control_msgs/msg/Longitudinal": "float32 velocity\nfloat32 acceleration",
    "autoware_control_msgs/msg/Control": "autoware_control_msgs/Longitudinal longitudinal",
    "autoware_auto_control_msgs/msg/LongitudinalCommand": "float32 speed\nfloat32 acceleration",
    "autoware_auto_control_msgs/msg/AckermannControlCommand": (
        "autoware_auto_control_msgs/LongitudinalCommand longitudinal"
    ),
    "tier4_vehicle_msgs/msg/ActuationCommand": "float64 accel_cmd\nfloat64 brake_cmd\nfloat64 steer_cmd",
    "tier4_vehicle_msgs/msg/ActuationCommandStamped": "tier4_vehicle_msgs/ActuationCommand actuation",
    "tier4_vehicle_msgs/msg/ActuationStatus": (
        "float64 accel_status\nfloat64 brake_status\nfloat64 steer_status"
    ),
    "tier4_vehicle_msgs/msg/ActuationStatusStamped": "tier4_vehicle_msgs/ActuationStatus status",
    "dbw_mkz_msgs/msg/ThrottleReport": "float32 pedal_input\nfloat32 pedal_cmd\nfloat32 pedal_output",
    "dbw_mkz_msgs/msg/BrakeReport": "float32 pedal_input\nfloat32 pedal_cmd\nfloat32 pedal_output",
    "dbw_mkz_msgs/msg/SteeringReport": "float32 steering_wheel_angle\nfloat32 speed",
    "dbw_mkz_msgs/msg/WheelSpeedReport": (
        "float32 front_left\nfloat32 front_right\nfloat32 rear_left\nfloat32 rear_right"
    ),
    "pacmod3_msgs/msg/SystemRptFloat": "bool enabled\nfloat64 manual_input\nfloat64 command\nfloat64 output",
    "pacmod3_msgs/msg/VehicleSpeedRpt": "float64 vehicle_speed\nbool vehicle_speed_valid",
    "apollo_msgs/msg/Chassis": (
        "float32 engine_rpm\nfloat32 speed_mps\nfloat32 throttle_percentage\nfloat32 brake_percentage\n"
        "int32 gear_location\nfloat32 throttle_percentage_cmd"
    ),
    "apollo_msgs/msg/ControlCommand": "float64 throttle\nfloat64 brake\nfloat64 speed\nfloat64 acceleration",
    "dataspeed_ulc_msgs/msg/UlcReport": "float64 speed_ref\nfloat64 speed_meas",
    "dataspeed_ulc_msgs/msg/UlcCmd": "float64 linear_velocity",
    "my_msgs/msg/Motion": "float32 speed_mps\nfloat32 acceleration_mps2",
    "my_msgs/msg/State": "my_msgs/Motion target\nmy_msgs/Motion actual",
    "my_msgs/msg/Deep": "my_msgs/State longitudinal",
    "my_msgs/msg/SpeedCommand": "float32 velocity",
    "my_msgs/msg/Axis": "float64 speed",
    "my_msgs/msg/Loop": "my_msgs/Axis setpoint\nmy_msgs/Axis feedback",
    "my_msgs/msg/Loops": "my_msgs/Loop inner",
    "my_msgs/msg/Short": "float32 speedTgt\nfloat32 des_vel\nfloat32 speedAct",
    "my_msgs/msg/Values": (
        "float32 speed_setpoint\nfloat32 ref_speed\nfloat32 desiredSpeed\nfloat32 vehicle_speed"
    ),
    "my_msgs/msg/Vehicle": "float32 velocity_mps\nfloat32[3] brakePressure_bar\nstring note",
}
STORE = get_typestore(Stores.ROS2_JAZZY)
for _kind, _text in TYPES.items():
    STORE.register(get_types_from_msg(_text, _kind))


def made(kind: str, values: Mapping[str, Any], k: int) -> Any:
    """The k-th message of a type."""
    parts: dict[str, Any] = {}
    for name, (sort, of) in STORE.get_msgdef(kind).fields:
        below = {p.partition(".")[2]: v for p, v in values.items() if p.partition(".")[0] == name}
        if sort.name == "NAME":
            parts[name] = made(of, below, k)
        elif "" in below:
            parts[name] = below[""](k) if callable(below[""]) else below[""]
            if isinstance(below[""], np.ndarray) and sort.name == "BASE":
                parts[name] = below[""][k]
        elif sort.name == "BASE":
            parts[name] = "" if of[0] == "string" else 0
        else:
            count = of[1] if sort.name == "ARRAY" else 0
            parts[name] = [] if of[0][1][0] == "string" else np.zeros(count)
    return STORE.types[kind](**parts)


def bag(
    path: Path, topics: Topics, hz: Mapping[str, int], storage: StoragePlugin = StoragePlugin.MCAP
) -> Path:
    """Ten seconds of these topics, at 10 Hz or another rate."""
    messages = []
    for topic, (kind, values) in topics.items():
        rate = hz.get(topic, 10)
        times = [S + k * S // rate for k in range(COUNT * rate // 10)]
        messages += [(topic, made(kind, values, k * 10 // rate), ns) for k, ns in enumerate(times)]
    return bag_of(path, sorted(messages, key=lambda m: m[2]), types=STORE, storage=storage)


FLOAT = "std_msgs/msg/Float64"
ODOMETRY = ("nav_msgs/msg/Odometry", {"twist.twist.linear.x": RAMP})
SPEED = ("/odom", "twist.twist.linear.x", "m/s")
JOINTS = ("sensor_msgs/msg/JointState", {
    "name": ["throttle", "BrakePedal"], "position": lambda k: np.array([0.01 * k, 0.2]),
    "velocity": np.zeros(0), "effort": np.zeros(0)})  # fmt: skip
PEDALS = {"engine_command": ("/pedals", "position[name=throttle]", "ratio"),
          "brake_command": ("/pedals", "position[name=BrakePedal]", "ratio")}  # fmt: skip
TWIST = "geometry_msgs/msg/TwistStamped"


@dataclass(frozen=True)
class Row:
    """Topics, and the line of each channel that is proposed; paths of `commanded` numbers, which are no
    measurement; and words of the file or of what is lacking."""

    topics: Topics
    proposes: dict[str, tuple[str, str, str]]
    commanded: set[str] = field(default_factory=set)
    says: tuple[str, ...] = ()
    hz: dict[str, int] = field(default_factory=dict)


def one(kind: str, measured: str = "", topic: str = "/s", **paths: Any) -> Row:
    """A speed of a type with several, of which one was measured."""
    values = {path.replace("__", "."): value for path, value in paths.items()}
    proposes = {"speed": (topic, measured, "m/s")} if measured else {}
    if measured.endswith("actual.speed_mps"):
        proposes["acceleration"] = (topic, measured.replace("speed_mps", "acceleration_mps2"), "m/s^2")
    return Row({topic: (kind, values)}, proposes, {p for p in values if p != measured})


def autoware(topic: str, kind: str, prefix: str, name: str) -> Row:
    status = "/vehicle/status/actuation_status"
    return Row(
        {
            topic: (kind, {f"{prefix}{name}": 25.0 + RAMP, f"{prefix}acceleration": 0.1 * RAMP}),
            "/vehicle/status/velocity_status": ("autoware_vehicle_msgs/msg/VelocityReport",
                {"longitudinal_velocity": RAMP}),
            "/control/command/actuation_cmd": (
                "tier4_vehicle_msgs/msg/ActuationCommandStamped",
                {"actuation.accel_cmd": PRESSED, "actuation.brake_cmd": PRESSED}),
            status: ("tier4_vehicle_msgs/msg/ActuationStatusStamped", {"status.accel_status": 0.9 * PRESSED}),
            "/vehicle/status/gear_status": ("autoware_vehicle_msgs/msg/GearReport", {"report": 2}),
        },
        {"speed": ("/vehicle/status/velocity_status", "longitudinal_velocity", "m/s"),
         "engine_command": (status, "status.accel_status", "ratio"),
             "brake_command": (status, "status.brake_status", "ratio")},
        {f"{prefix}{name}", f"{prefix}acceleration"},
        (f"{prefix}{name} is a command, not taken", "needs its codes turned into gear numbers"),
    )  # fmt: skip


CHASSIS = "/apollo/canbus/chassis"
PACMOD = "pacmod3_msgs/msg/SystemRptFloat"
ROWS: dict[str, Row] = {
    "odometry and pedals": Row({"/odom": ODOMETRY, "/pedals": JOINTS}, {"speed": SPEED, **PEDALS}),
    "two speeds": Row({"/odom": ODOMETRY, "/pedals": JOINTS,
        "/wheel/speed_kmh": (FLOAT, {"data": 3.6 * RAMP})}, {"speed": SPEED, **PEDALS},
                      says=("2 candidates", "\n# speed: {topic: /wheel/speed_kmh, field: data, unit: km/h}"),
                          hz={"/wheel/speed_kmh": 50}),
    "a fuel rate without a unit": Row({"/odom": ODOMETRY, "/fuel": (FLOAT, {"data": 20.0})},
        {"speed": SPEED}, says=(
        "engine_command has no line yet", "brake_command has no line yet",
            "# engine_command: engine command; negative retards. NOT FOUND",
        "the orientation in /odom is a quaternion")),
    "a brake of no unit": Row({"/brake": (FLOAT, {"data": 0.1 * np.arange(COUNT)})}, {}, says=(
        "say in which unit it is", '# brake_command: {topic: /brake, field: data, unit: "?"}')),
    "a unit that does not fit": Row({"/speed_mps": (FLOAT, {"data": 0.9 * np.arange(COUNT)})}, {}, says=(
        "/speed_mps, data needs another source", "outside -1..60")),
    "an odometry without a twist": Row(
        {"/odom": ("nav_msgs/msg/Odometry", {"pose.pose.position.x": np.cumsum(RAMP) / 10}),
            "/pedals": JOINTS}, PEDALS,
        says=("twist.twist.linear.x needs another source",)),
    "sensors": Row(
        {"/imu": ("sensor_msgs/msg/Imu", {"linear_acceleration.z": 9.8}),
         "/gps": ("sensor_msgs/msg/NavSatFix", {"latitude": 48.0, "longitude": 11.5, "altitude": 500.0})},
        {"specific_force": ("/imu", "linear_acceleration.x", "m/s^2"), "elevation": ("/gps", "altitude", "m"),
         "latitude": ("/gps", "latitude", "deg"), "longitude": ("/gps", "longitude", "deg")},
        says=("speed has no line yet, without it there is no recording",)),
    "a twist of a truck": Row({"/truck/vel": (TWIST, {"twist.linear.x": RAMP})},
        {"speed": ("/truck/vel", "twist.linear.x", "m/s")}),
    "a twist of a radar": Row({"/radar/twist": (TWIST, {"twist.linear.x": RAMP})},
        {"leader_speed": ("/radar/twist", "twist.linear.x", "m/s")}),
    "a twist that is demanded": Row({"/cmd_vel": (TWIST, {"twist.linear.x": RAMP})}, {}, {"twist.linear.x"}),
    "Autoware": autoware("/control/command/control_cmd", "autoware_control_msgs/msg/Control",
        "longitudinal.", "velocity"),
    "Autoware, longitudinal": autoware("/a", "autoware_control_msgs/msg/Longitudinal", "", "velocity"),
    "Autoware.Auto": autoware("/a", "autoware_auto_control_msgs/msg/AckermannControlCommand",
        "longitudinal.", "speed"),
    "commands alone": Row({"/c": ("autoware_control_msgs/msg/Control", {"longitudinal.velocity": RAMP})}, {},
        {"longitudinal.velocity"}, says=(
        "speed has no line yet", "# speed: longitudinal speed, forward positive. NOT FOUND")),
    "Dataspeed": Row(
        {"/vehicle/throttle_report": ("dbw_mkz_msgs/msg/ThrottleReport", {"pedal_output": PRESSED}),
         "/vehicle/brake_report": ("dbw_mkz_msgs/msg/BrakeReport",
             {"pedal_input": 0.15, "pedal_cmd": PRESSED, "pedal_output": PRESSED}),
         "/vehicle/steering_report": ("dbw_mkz_msgs/msg/SteeringReport", {"speed": RAMP}),
         "/vehicle/wheel_speed_report": ("dbw_mkz_msgs/msg/WheelSpeedReport", {"front_left": 2.0 * RAMP})},
        {"speed": ("/vehicle/steering_report", "speed", "m/s"),
            "engine_command": ("/vehicle/throttle_report", "pedal_output", "ratio"),
         "brake_command": ("/vehicle/brake_report", "pedal_output", "ratio")},
             says=("the tyre's radius in m as scale",)),
    "PACMod, by its topics": Row(
        {"/pacmod/accel_rpt": (PACMOD, {"command": PRESSED, "output": 0.5 * PRESSED}),
         "/pacmod/brake_rpt": (PACMOD, {"command": PRESSED, "output": 0.5 * PRESSED}),
             "/pacmod/steering_rpt": (PACMOD, {"output": PRESSED}),
         "/pacmod/vehicle_speed_rpt": ("pacmod3_msgs/msg/VehicleSpeedRpt", {"vehicle_speed": RAMP})},
        {"speed": ("/pacmod/vehicle_speed_rpt", "vehicle_speed", "m/s"),
            "engine_command": ("/pacmod/accel_rpt", "output", "ratio"),
         "brake_command": ("/pacmod/brake_rpt", "output", "ratio")}),
    "Apollo": Row(
        {"/apollo/control": ("apollo_msgs/msg/ControlCommand",
            {"throttle": 3 * RAMP, "brake": RAMP, "speed": 2 * RAMP, "acceleration": 0.1 * RAMP}),
         CHASSIS: ("apollo_msgs/msg/Chassis",
             {"speed_mps": RAMP, "throttle_percentage": 2.0 * RAMP, "engine_rpm": 100.0 * RAMP})},
        {"speed": (CHASSIS, "speed_mps", "m/s"), "engine_speed": (CHASSIS, "engine_rpm", "rpm"),
         "engine_command": (CHASSIS, "throttle_percentage", "percent"),
             "brake_command": (CHASSIS, "brake_percentage", "percent")},
        {"speed", "acceleration"}),
    "target and actual": one("my_msgs/msg/State", "actual.speed_mps", target__speed_mps=RAMP,
        actual__speed_mps=RAMP),
    "target and actual below": one("my_msgs/msg/Deep", "longitudinal.actual.speed_mps",
        longitudinal__target__speed_mps=RAMP,
                                   longitudinal__actual__speed_mps=RAMP),
    "a type of commands": one("my_msgs/msg/SpeedCommand", velocity=RAMP),
    "reference and measured": one("dataspeed_ulc_msgs/msg/UlcReport", "speed_meas", speed_ref=RAMP,
        speed_meas=RAMP),
    "a type of short commands": one("dataspeed_ulc_msgs/msg/UlcCmd", linear_velocity=RAMP),
    "setpoint and feedback": one("my_msgs/msg/Loops", "inner.feedback.speed", inner__setpoint__speed=RAMP,
        inner__feedback__speed=RAMP),
    "short words": one("my_msgs/msg/Short", "speedAct", speedTgt=RAMP, des_vel=RAMP, speedAct=RAMP),
    "a topic of set points": one("my_msgs/msg/Axis", topic="/v_soll", speed=RAMP),
    "a topic of goals": one("my_msgs/msg/Motion", topic="/goal/motion", speed_mps=RAMP,
        acceleration_mps2=0.1 * RAMP),
    "a topic of control": one("my_msgs/msg/Motion", topic="/control/motion", speed_mps=RAMP),
    "many words": one("my_msgs/msg/Values", "vehicle_speed", speed_setpoint=RAMP, ref_speed=RAMP,
        desiredSpeed=RAMP, vehicle_speed=RAMP),
    **{f"{topic} up to {value:g}": Row(
        {topic: (FLOAT, {"data": value * (np.arange(COUNT) / COUNT + 0.01)})},
            {channel: (topic, "data", unit)} if channel else {})
       for topic, value, channel, unit in (
           ("/throttle", 0.9, "engine_command", "ratio"), ("/throttle", 90.0, "engine_command", "percent"),
           ("/torque_request", 1500.0, "engine_command", "N m"),
               ("/brake_pressure", 8.0, "brake_command", "bar"),
           ("/brake_pressure", 800.0, "brake_command", "kPa"), ("/brake", 60.0, "brake_command", "percent"),
           ("/vehicleSpeed", 80.0, "speed", "km/h"), ("/lead_speed", 20.0, "leader_speed", "m/s"),
               ("/road/pitch", 0.05, "grade", "rad"),
           ("/road/slope_percent", 5.0, "grade", "percent"), ("/engine_speed", 1500.0, "engine_speed", "rpm"),
           ("/outside_temperature", 290.0, "ambient_temperature", "K"),
               ("/fuel_rate_lph", 20.0, "fuel_rate", "l/h"),
           ("/speed_limit", 20.0, "", ""), ("/cruise/target_speed", 20.0, "", ""),
               ("/brake_temperature", 200.0, "", ""),
           ("/battery", 0.9, "", ""))},
}  # fmt: skip


@pytest.mark.parametrize("name", ROWS)
def test_what_is_proposed(tmp_path: Path, name: str) -> None:
    row = ROWS[name]
    found = suggest(bag(tmp_path / "bag", row.topics, row.hz))
    taken = {channel: found.taken(channel) for channel in found.candidates}
    assert {
        c: (t.topic.name, t.field.path, t.unit) for c, t in taken.items() if t and t.topic
    } == row.proposes
    commanded = {one.field.path for several in found.commanded.values() for one in several}
    assert commanded >= row.commanded
    text = "\n".join((found.text(), *found.lacking))
    for words_of in row.says:
        assert words_of in text
    if "speed" in row.proposes:
        topics = tmp_path / "topics.yaml"
        topics.write_text(found.text())
        (recording,) = read(tmp_path / "bag", topic_map=topics)
        topic, path, unit = row.proposes["speed"]
        if unit == "m/s":
            wanted = row.topics[topic][1][path]
            np.testing.assert_allclose(recording.channels["speed"], wanted, rtol=1e-6)
        pedals = {"Dataspeed": (100.0 * 0.35 / 0.65, 100.0), "odometry and pedals": (99.0, 20.0)}
        for channel, last in zip(DEMANDS, pedals.get(name, ()), strict=False):
            values = recording.channels[channel]
            assert values[np.isfinite(values)][-1] == pytest.approx(last, abs=1.0)


def proposed(tmp_path: Path, **topics: tuple[str, Values]) -> Suggestion:
    return suggest(bag(tmp_path / "bag", {f"/{name}": of for name, of in topics.items()}, {"/a": 50}))


def test_fields_have_their_range_and_rate(tmp_path: Path) -> None:
    nan: Callable[[int], float] = lambda k: np.nan if k else 3.0  # noqa: E731
    found = proposed(tmp_path, odom=ODOMETRY, a=(FLOAT, {"data": nan}))
    by_name = {topic.name: topic for topic in found.survey.topics}
    assert by_name["/a"].rate_hz == pytest.approx(50.0) and by_name["/a"].messages == 500
    assert by_name["/a"].fields == [Field("data", 3.0, 3.0)]
    ranges = {one.path: (one.low, one.high) for one in by_name["/odom"].fields}
    assert ranges["twist.twist.linear.x"] == (RAMP.min(), RAMP.max())
    assert not any("covariance" in path or "stamp" in path for path in ranges)


def test_pacmods_output_comes_before_what_a_driver_or_a_controller_asks(tmp_path: Path) -> None:
    found = proposed(
        tmp_path, **{"pacmod/accel_rpt": (PACMOD, {"command": PRESSED, "output": 0.5 * PRESSED})}
    )
    assert [one.field.path for one in found.candidates["engine_command"]] == [
        "output",
        "manual_input",
        "command",
    ]


@pytest.mark.parametrize("storage", [StoragePlugin.MCAP, StoragePlugin.SQLITE3])
def test_a_type_that_only_the_bag_defines(tmp_path: Path, storage: StoragePlugin) -> None:
    values = {"velocity_mps": 0.1 * np.arange(COUNT), "note": lambda k: "a" * (k % 5),
              "brakePressure_bar": lambda k: np.full(3, k / 10, np.float32)}  # fmt: skip
    found = suggest(bag(tmp_path / "bag", {"/vehicle": ("my_msgs/msg/Vehicle", values)}, {}, storage))
    paths = {c: [(one.field.path, one.unit) for one in several] for c, several in found.candidates.items()}
    assert paths["speed"] == [("velocity_mps", "m/s")]
    assert paths["brake_command"] == [(f"brakePressure_bar[{k}]", "bar") for k in range(3)]
    (tmp_path / "topics.yaml").write_text(found.text())
    (recording,) = read(tmp_path / "bag", topic_map=tmp_path / "topics.yaml")
    assert recording.channels["brake_command"][-1] == pytest.approx((COUNT - 1) / 10)


def test_long_messages_are_listed_only(tmp_path: Path) -> None:
    image = ("sensor_msgs/msg/CompressedImage", {"format": "png", "data": np.zeros(5000, np.uint8)})
    found = proposed(tmp_path, odom=ODOMETRY, camera=image)
    camera = next(topic for topic in found.survey.topics if topic.name == "/camera")
    assert "longer than 4096 bytes" in camera.why and not camera.fields


def test_names_that_mean_something_in_yaml(tmp_path: Path) -> None:
    names = ["throttle: {", "brake #1", "a.brake", "a]brake", "line\nbrake"]
    state = {**JOINTS[1], "name": names, "position": np.full(5, 0.5)}
    found = proposed(tmp_path, odom=ODOMETRY, pedals=(JOINTS[0], state))
    assert yaml.safe_load(found.text())["engine_command"]["field"] == "position[name=throttle: {]"
    assert [one.field.path for one in found.candidates["brake_command"]] == [
        "position[name=a.brake]", "position[name=brake #1]",
    ]  # fmt: skip


def test_a_bag_of_ours_comes_back_as_it_was(
    tmp_path: Path, drive: Recording, interface: TruckInterface
) -> None:
    ours_bag = write_bag(tmp_path / "bag", [drive], interface=interface)
    (tmp_path / "topics.yaml").write_text(suggest(ours_bag).text())
    (ours,), (mapped,) = read(ours_bag), read(ours_bag, topic_map=tmp_path / "topics.yaml")
    assert mapped.interface == ours.interface
    for name in ("speed", "acceleration", "engine_command", "brake_command", "grade"):
        np.testing.assert_allclose(mapped.channels[name], ours.channels[name])


NOISE = np.random.default_rng(0).normal(0.0, 1.0, 1200)


@pytest.mark.parametrize(
    ("twist", "says"),
    [
        (0.0 * NOISE[:100], "100 are zero while positions move on.*take another speed"),
        (0.002 * NOISE, "speed does not follow the pose of its messages"),
        (5.0 + 0.0 * NOISE, "speed does not follow the pose of its messages"),
        (0.1 * NOISE, "speed does not follow the pose of its messages"),
    ],
)
def test_a_twist_that_was_frozen_or_never_filled_is_refused(tmp_path: Path, twist: Any, says: str) -> None:
    way = np.cumsum(15.0 + 6.0 * np.sin(np.arange(1200) / 100.0)) / 10.0
    of = {"pose.pose.position.x": lambda k: way[k], "twist.twist.linear.x": lambda k: float(twist[k])}
    messages = [("/odom", made("nav_msgs/msg/Odometry", of, k), S + k * S // 10) for k in range(len(twist))]
    with pytest.raises(InputError, match=says):
        read(
            bag_of(tmp_path / "bag", messages, types=STORE),
            topic_map={"speed": {"topic": "/odom", "field": "twist.twist.linear.x"}},
        )


def test_words_of_names() -> None:
    assert words("/vehicle/BrakeCmd_2") == {"vehicle", "brake", "cmd"}
    assert words("engineRPM") == {"engine", "rpm"}


def test_the_table_of_types_is_sound() -> None:
    for kind, fields in MESSAGE_TYPES.items():
        for path, several in fields.items():
            for known in several:
                assert known.channel in CHANNELS, (kind, path)
                if known.unit is not None:
                    conversion(known.channel, known.unit)
                asked = {"cmd", "command"} & {*path.replace(".", "_").split("_")}
                assert (known.role is Role.COMMANDED) >= bool(asked), (kind, path)
    commanded = {
        one.channel for f in MESSAGE_TYPES.values() for s in f.values() for one in s if one.role == 2
    }
    assert commanded >= {"speed", "acceleration", *DEMANDS}
    assert not STATISTIC & UNIT_WORDS.keys()
