"""A command is never proposed as a measurement: known message types, and words anywhere in others."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from foreign_bags import S, bag_of
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from deeptruck_core.signals import CHANNELS
from deeptruck_model.recordings import read, suggest
from deeptruck_model.recordings.candidates import DEMANDS
from deeptruck_model.recordings.message_types import MESSAGE_TYPES, Role
from deeptruck_model.recordings.suggestion import Suggestion
from deeptruck_model.recordings.units import conversion
from deeptruck_model.recordings.words import STATISTIC, UNIT_WORDS

COUNT = 100
Topics = Mapping[str, tuple[str, dict[str, Any]]]  # topic: type, value (or its series) by path

AUTOWARE = {
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
}
OTHERS = {
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
    "my_msgs/msg/Motion": "float32 speed_mps\nfloat32 acceleration_mps2",
    "my_msgs/msg/State": "my_msgs/Motion target\nmy_msgs/Motion actual",
    "my_msgs/msg/Deep": "my_msgs/State longitudinal",
    "my_msgs/msg/SpeedCommand": "float32 velocity",
    "dataspeed_ulc_msgs/msg/UlcReport": "float64 speed_ref\nfloat64 speed_meas",
    "dataspeed_ulc_msgs/msg/UlcCmd": "float64 linear_velocity",
    "my_msgs/msg/Axis": "float64 speed",
    "my_msgs/msg/Loop": "my_msgs/Axis setpoint\nmy_msgs/Axis feedback",
    "my_msgs/msg/Loops": "my_msgs/Loop inner",
    "my_msgs/msg/Short": "float32 speedTgt\nfloat32 des_vel\nfloat32 speedAct",
    "my_msgs/msg/Values": (
        "float32 speed_setpoint\nfloat32 ref_speed\nfloat32 desiredSpeed\nfloat32 vehicle_speed"
    ),
}
RAMP = np.linspace(10.0, 20.0, COUNT)


def suggested(path: Path, topics: Topics) -> Suggestion:
    types = get_typestore(Stores.ROS2_JAZZY)
    for kind, text in {**AUTOWARE, **OTHERS}.items():
        types.register(get_types_from_msg(text, kind))

    def made(kind: str, values: Mapping[str, Any], k: int) -> Any:
        parts = {}
        for name, (sort, of) in types.get_msgdef(kind).fields:
            below = {p.partition(".")[2]: v for p, v in values.items() if p.partition(".")[0] == name}
            if sort.name == "NAME":
                parts[name] = made(of, below, k)
            else:
                value = below.get("", 0)
                parts[name] = value[k] if isinstance(value, np.ndarray) else value
        return types.types[kind](**parts)

    messages = (
        (topic, made(kind, values, k), S + k * S // 10)
        for topic, (kind, values) in topics.items()
        for k in range(COUNT)
    )
    return suggest(bag_of(path, messages, types=types))


def proposed(found: Suggestion) -> dict[str, tuple[str, str, str]]:
    taken = {channel: found.taken(channel) for channel in found.candidates}
    return {c: (one.topic.name, one.field.path, one.unit) for c, one in taken.items() if one}


def set_points(found: Suggestion) -> set[str]:
    return {one.field.path for several in found.commanded.values() for one in several}


@pytest.mark.parametrize(
    ("topic", "kind", "prefix", "speed"),
    [
        ("/control/command/control_cmd", "autoware_control_msgs/msg/Control", "longitudinal.", "velocity"),
        ("/a", "autoware_control_msgs/msg/Longitudinal", "", "velocity"),
        ("/a", "autoware_auto_control_msgs/msg/AckermannControlCommand", "longitudinal.", "speed"),
    ],
)
def test_autoware(tmp_path: Path, topic: str, kind: str, prefix: str, speed: str) -> None:
    pedals = np.linspace(0.0, 0.5, COUNT)
    found = suggested(
        tmp_path / "bag",
        {
            topic: (kind, {f"{prefix}{speed}": 25.0 + RAMP, f"{prefix}acceleration": 0.1 * RAMP}),
            "/vehicle/status/velocity_status": (
                "autoware_vehicle_msgs/msg/VelocityReport",
                {"longitudinal_velocity": RAMP, "lateral_velocity": 0.01 * RAMP},
            ),
            "/control/command/actuation_cmd": (
                "tier4_vehicle_msgs/msg/ActuationCommandStamped",
                {"actuation.accel_cmd": pedals, "actuation.brake_cmd": pedals},
            ),
            "/vehicle/status/actuation_status": (
                "tier4_vehicle_msgs/msg/ActuationStatusStamped",
                {"status.accel_status": 0.9 * pedals},
            ),
            "/vehicle/status/gear_status": ("autoware_vehicle_msgs/msg/GearReport", {"report": 2}),
        },
    )
    status = "/vehicle/status/actuation_status"
    assert proposed(found) == {
        "speed": ("/vehicle/status/velocity_status", "longitudinal_velocity", "m/s"),
        "engine_command": (status, "status.accel_status", "ratio"),
        "brake_command": (status, "status.brake_status", "ratio"),
    }
    assert set_points(found) == {f"{prefix}{speed}", f"{prefix}acceleration"}
    assert f"{prefix}{speed} is a command, not taken" in found.text()
    assert "needs its codes turned into gear numbers" in found.text()
    (tmp_path / "topics.yaml").write_text(found.text())
    (recording,) = read(tmp_path / "bag", topic_map=tmp_path / "topics.yaml")
    np.testing.assert_allclose(recording.channels["speed"], RAMP, rtol=1e-6)


def test_a_bag_of_commands_alone_has_no_speed(tmp_path: Path) -> None:
    kind = "autoware_control_msgs/msg/Control"
    found = suggested(tmp_path / "bag", {"/c": (kind, {"longitudinal.velocity": RAMP})})
    assert not proposed(found) and "speed has no line yet" in found.lacking[0]
    assert "# speed: longitudinal speed, forward positive. NOT FOUND" in found.text()


def test_dataspeed(tmp_path: Path) -> None:
    pressed = np.linspace(0.15, 0.5, COUNT)
    found = suggested(
        tmp_path / "bag",
        {
            "/vehicle/throttle_report": ("dbw_mkz_msgs/msg/ThrottleReport", {"pedal_output": pressed}),
            "/vehicle/brake_report": (
                "dbw_mkz_msgs/msg/BrakeReport",
                {"pedal_input": 0.15, "pedal_cmd": pressed, "pedal_output": pressed},
            ),
            "/vehicle/steering_report": ("dbw_mkz_msgs/msg/SteeringReport", {"speed": RAMP}),
            "/vehicle/wheel_speed_report": ("dbw_mkz_msgs/msg/WheelSpeedReport", {"front_left": 2.0 * RAMP}),
        },
    )
    assert proposed(found) == {
        "speed": ("/vehicle/steering_report", "speed", "m/s"),
        "engine_command": ("/vehicle/throttle_report", "pedal_output", "ratio"),
        "brake_command": ("/vehicle/brake_report", "pedal_output", "ratio"),
    }
    assert "the tyre's radius in m as scale" in found.text()
    (tmp_path / "topics.yaml").write_text(found.text())
    (recording,) = read(tmp_path / "bag", topic_map=tmp_path / "topics.yaml")
    brake = recording.channels["brake_command"]
    assert brake[~np.isnan(brake)][-1] == pytest.approx(100.0, abs=1.0)
    assert recording.channels["engine_command"][-1] == pytest.approx(100.0 * 0.35 / 0.65, abs=1.0)


def test_pacmod_by_its_topics(tmp_path: Path) -> None:
    kind = "pacmod3_msgs/msg/SystemRptFloat"
    pedals = np.linspace(0.0, 0.6, COUNT)
    found = suggested(
        tmp_path / "bag",
        {
            "/pacmod/accel_rpt": (kind, {"command": pedals, "output": 0.5 * pedals}),
            "/pacmod/brake_rpt": (kind, {"command": pedals, "output": 0.5 * pedals}),
            "/pacmod/steering_rpt": (kind, {"output": pedals}),
            "/pacmod/vehicle_speed_rpt": ("pacmod3_msgs/msg/VehicleSpeedRpt", {"vehicle_speed": RAMP}),
        },
    )
    assert proposed(found) == {
        "speed": ("/pacmod/vehicle_speed_rpt", "vehicle_speed", "m/s"),
        "engine_command": ("/pacmod/accel_rpt", "output", "ratio"),
        "brake_command": ("/pacmod/brake_rpt", "output", "ratio"),
    }
    order = [one.field.path for one in found.candidates["engine_command"]]
    assert order == ["output", "manual_input", "command"]


def test_apollo(tmp_path: Path) -> None:
    found = suggested(
        tmp_path / "bag",
        {
            "/apollo/control": (
                "apollo_msgs/msg/ControlCommand",
                {"throttle": 3.0 * RAMP, "brake": RAMP, "speed": 2.0 * RAMP, "acceleration": 0.1 * RAMP},
            ),
            "/apollo/canbus/chassis": (
                "apollo_msgs/msg/Chassis",
                {"speed_mps": RAMP, "throttle_percentage": 2.0 * RAMP, "engine_rpm": 100.0 * RAMP},
            ),
        },
    )
    chassis = "/apollo/canbus/chassis"
    assert proposed(found) == {
        "speed": (chassis, "speed_mps", "m/s"),
        "engine_speed": (chassis, "engine_rpm", "rpm"),
        "engine_command": (chassis, "throttle_percentage", "percent"),
        "brake_command": (chassis, "brake_percentage", "percent"),
    }
    assert set_points(found) == {"speed", "acceleration"}


@pytest.mark.parametrize(
    ("topic", "kind", "values", "measured"),
    [
        ("/s", "my_msgs/msg/State", {"target.speed_mps": RAMP, "actual.speed_mps": RAMP}, "actual.speed_mps"),
        (
            "/s",
            "my_msgs/msg/Deep",
            {"longitudinal.target.speed_mps": RAMP, "longitudinal.actual.speed_mps": RAMP},
            "longitudinal.actual.speed_mps",
        ),
        ("/s", "my_msgs/msg/SpeedCommand", {"velocity": RAMP}, ""),
        ("/s", "dataspeed_ulc_msgs/msg/UlcReport", {"speed_ref": RAMP, "speed_meas": RAMP}, "speed_meas"),
        ("/s", "dataspeed_ulc_msgs/msg/UlcCmd", {"linear_velocity": RAMP}, ""),
        (
            "/s",
            "my_msgs/msg/Loops",
            {"inner.setpoint.speed": RAMP, "inner.feedback.speed": RAMP},
            "inner.feedback.speed",
        ),
        ("/s", "my_msgs/msg/Short", {"speedTgt": RAMP, "des_vel": RAMP, "speedAct": RAMP}, "speedAct"),
        ("/v_soll", "my_msgs/msg/Axis", {"speed": RAMP}, ""),
        ("/goal/motion", "my_msgs/msg/Motion", {"speed_mps": RAMP, "acceleration_mps2": 0.1 * RAMP}, ""),
        ("/control/motion", "my_msgs/msg/Motion", {"speed_mps": RAMP}, ""),
        (
            "/s",
            "my_msgs/msg/Values",
            {"speed_setpoint": RAMP, "ref_speed": RAMP, "desiredSpeed": RAMP, "vehicle_speed": RAMP},
            "vehicle_speed",
        ),
    ],
)
def test_words_anywhere_say_command(
    tmp_path: Path, topic: str, kind: str, values: dict[str, Any], measured: str
) -> None:
    found = suggested(tmp_path / "bag", {topic: (kind, values)})
    assert [one.field.path for one in found.candidates.get("speed", [])] == ([measured] if measured else [])
    assert {path for path in values if path != measured} <= set_points(found)


def test_the_table_of_types_is_sound() -> None:
    for kind, fields in MESSAGE_TYPES.items():
        for path, several in fields.items():
            for one in several:
                assert one.channel in CHANNELS, (kind, path)
                if one.unit is not None:
                    conversion(one.channel, one.unit)
                words = {"cmd", "command"} & {*path.replace(".", "_").split("_")}
                assert (one.role is Role.COMMANDED) >= bool(words), (kind, path)
    commanded = {
        one.channel for f in MESSAGE_TYPES.values() for s in f.values() for one in s if one.role == 2
    }
    assert commanded >= {"speed", "acceleration", *DEMANDS}
    assert not STATISTIC & UNIT_WORDS.keys()
