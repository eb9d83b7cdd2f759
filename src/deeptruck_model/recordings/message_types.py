"""Data: the fields of known message types with channel, unit, and whether they were measured or commanded.

Units are those of the message definitions; None stands where a definition states none. A field of a type
listed here that has no entry is none of our channels.
"""

from __future__ import annotations

import enum
from dataclasses import dataclass


class Role(enum.IntEnum):
    """Where a number comes from; of several candidates the lowest role is proposed."""

    MEASURED = 0
    DRIVER = 1  # what the driver demands, where an actuator's output is measured too
    COMMANDED = 2  # a set point or request, whether it was obeyed or not


@dataclass(frozen=True)
class Known:
    """One field. `scale` and `offset` come before the unit, as in a topic map.

    `on`: words of which the topic must have one. `needs`: what must be filled in before it is of use.
    """

    channel: str
    unit: str | None
    why: str
    role: Role = Role.MEASURED
    scale: float = 1.0
    offset: float = 0.0
    on: frozenset[str] = frozenset()
    needs: str = ""


Fields = dict[str, Known | tuple[Known, ...]]

FORWARD = "forward speed, as x is forward (REP 103)"
GNSS = "position by satellites"
WITH_QUATERNION = ("sensor_msgs/msg/Imu", "nav_msgs/msg/Odometry")

_RADIUS = "the tyre's radius in m as scale, and unit: m/s"
_WHEEL = Known("speed", None, "a wheel's speed in rad/s", needs=_RADIUS)
_SIDES = ("front_left", "front_right", "rear_left", "rear_right")
_CODED = "its codes turned into gear numbers (no scale does that)"
_THROTTLE = frozenset(("accel", "accelerator", "throttle"))
_BRAKE = frozenset(("brake",))
_DECELERATION = frozenset(("decel", "deccel"))  # PACMod 1 spells it so


def _speed(why: str, unit: str | None = "m/s", role: Role = Role.MEASURED) -> Known:
    return Known("speed", unit, why, role)


def _asked(channel: str, unit: str | None, why: str = "a set point of the controller") -> Known:
    return Known(channel, unit, why, Role.COMMANDED)


def _longitudinal(prefix: str, speed: str) -> Fields:
    """The desired motion of a control message."""
    return {
        f"{prefix}{speed}": _asked("speed", "m/s"),
        f"{prefix}acceleration": _asked("acceleration", "m/s^2"),
    }


def _pedals(prefix: str, suffix: str, role: Role, what: str) -> Fields:
    return {
        f"{prefix}accel_{suffix}": Known("engine_command", None, f"accelerator pedal, {what}", role),
        f"{prefix}brake_{suffix}": Known("brake_command", None, f"brake pedal, {what}", role),
    }


def _pacmod(field: str, role: Role, what: str) -> Fields:
    """A float system of PACMod; its topic says which. The definition says %, the values go from 0 to 1."""
    return {
        field: (
            Known("engine_command", None, f"accelerator, {what}", role, on=_THROTTLE),
            Known("brake_command", "m/s^2", f"deceleration, {what}", role, on=_DECELERATION),
            Known("brake_command", None, f"brake, {what}", role, on=_BRAKE),
        )
    }


def _dataspeed(channel: str, span: float, note: str) -> Fields:
    """A pedal that reads 0.15 released and 0.15 + span pressed."""
    scale, offset = round(1.0 / span, 4), round(-0.15 / span, 4)

    def pedal(what: str, role: Role) -> Known:
        return Known(channel, "ratio", f"{what}, {note}", role, scale, offset)

    return {
        "pedal_output": pedal("what the pedal's wire carries", Role.MEASURED),
        "pedal_input": pedal("the driver's pedal", Role.DRIVER),
        "pedal_cmd": pedal("the requested pedal", Role.COMMANDED),
    }


def _percent(channel: str) -> Fields:
    return {
        "percent_output": Known(channel, "percent", "the actuator's output"),
        "percent_input": Known(channel, "percent", "the driver's pedal", Role.DRIVER),
        "percent_cmd": Known(channel, "percent", "a request", Role.COMMANDED),
    }


_TWIST = _speed(FORWARD)
_ENGINE: Fields = {
    "engine_speed": Known("engine_speed", "rpm", "what the engine reports"),
    "engine_torque": Known("engine_torque", "N m", "what the engine reports"),
}
_AUTOWARE = ("autoware_vehicle_msgs", "autoware_auto_vehicle_msgs")
_TIER4 = ("tier4_vehicle_msgs", "autoware_vehicle_msgs")
_MKZ = ("dbw_mkz_msgs", "dbw_ford_msgs")
_FCA = ("dbw_fca_msgs", "dbw_polaris_msgs")
_DATASPEED = (*_MKZ, *_FCA)
_PACMOD = ("pacmod_msgs", "pacmod3_msgs", "pacmod4_msgs")
_APOLLO = (
    "apollo_msgs",
    "apollo_canbus_msgs",
    "apollo_chassis_msgs",
    "canbus_msgs",
    "canbus",
    "chassis_msgs",
)

_TABLE: tuple[tuple[tuple[str, ...], str, Fields], ...] = (  # packages, type, fields
    # ROS itself
    (("nav_msgs",), "Odometry", {"twist.twist.linear.x": _TWIST}),
    (("geometry_msgs",), "Twist", {"linear.x": _TWIST}),
    (("geometry_msgs",), "TwistStamped", {"twist.linear.x": _TWIST}),
    (("geometry_msgs",), "TwistWithCovarianceStamped", {"twist.twist.linear.x": _TWIST}),
    (
        ("geometry_msgs",),
        "AccelStamped",
        {"accel.linear.x": Known("acceleration", "m/s^2", "x is forward (REP 103)")},
    ),
    (
        ("geometry_msgs",),
        "AccelWithCovarianceStamped",
        {"accel.accel.linear.x": Known("acceleration", "m/s^2", "x is forward (REP 103)")},
    ),
    (
        ("sensor_msgs",),
        "Imu",
        {
            "linear_acceleration.x": Known(
                "acceleration",
                "m/s^2",
                "forward if the sensor is mounted so; it has gravity in it on slopes: leave out if in doubt",
            )
        },
    ),
    (
        ("sensor_msgs",),
        "NavSatFix",
        {
            "altitude": Known("elevation", "m", "height by satellites"),
            "latitude": Known("latitude", "deg", GNSS),
            "longitude": Known("longitude", "deg", GNSS),
        },
    ),
    (
        ("sensor_msgs",),
        "Range",
        {"range": Known("gap", "m", "distance to what is ahead, if the sensor looks ahead")},
    ),
    (
        ("sensor_msgs",),
        "Temperature",
        {
            "temperature": Known(
                "ambient_temperature", "degC", "a temperature; check that it is that of the air"
            )
        },
    ),
    (("ackermann_msgs",), "AckermannDrive", _longitudinal("", "speed")),
    (("ackermann_msgs",), "AckermannDriveStamped", _longitudinal("drive.", "speed")),
    # Autoware
    (_AUTOWARE, "VelocityReport", {"longitudinal_velocity": _speed("what the vehicle reports, forward")}),
    (_AUTOWARE, "SteeringReport", {}),
    (
        _AUTOWARE,
        "GearReport",
        {"report": Known("gear", None, "a code: 1 neutral, 2 drive, 20 reverse, 22 park", needs=_CODED)},
    ),
    (
        _AUTOWARE,
        "GearCommand",
        {"command": Known("gear", None, "the requested gear", Role.COMMANDED)},
    ),
    (("autoware_control_msgs",), "Control", _longitudinal("longitudinal.", "velocity")),
    (("autoware_control_msgs",), "Longitudinal", _longitudinal("", "velocity")),
    (("autoware_auto_control_msgs",), "AckermannControlCommand", _longitudinal("longitudinal.", "speed")),
    (("autoware_auto_control_msgs",), "LongitudinalCommand", _longitudinal("", "speed")),
    (_TIER4, "ActuationCommandStamped", _pedals("actuation.", "cmd", Role.COMMANDED, "requested")),
    (_TIER4, "ActuationCommand", _pedals("", "cmd", Role.COMMANDED, "requested")),
    (_TIER4, "ActuationStatusStamped", _pedals("status.", "status", Role.MEASURED, "as reported")),
    (_TIER4, "ActuationStatus", _pedals("", "status", Role.MEASURED, "as reported")),
    (
        ("autoware_msgs",),
        "VehicleStatus",
        {
            "speed": _speed("what the vehicle reports", "km/h"),
            "drivepedal": Known("engine_command", None, "accelerator pedal"),
            "brakepedal": Known("brake_command", None, "brake pedal"),
        },
    ),
    # Apollo, whose protobuf messages several bridges write as ROS types
    (
        _APOLLO,
        "Chassis",
        {
            "speed_mps": _speed("what the chassis reports"),
            "engine_rpm": Known("engine_speed", "rpm", "what the chassis reports"),
            "throttle_percentage": Known("engine_command", "percent", "the throttle's position"),
            "brake_percentage": Known("brake_command", "percent", "the brake's position"),
            "throttle_percentage_cmd": _asked("engine_command", "percent"),
            "brake_percentage_cmd": _asked("brake_command", "percent"),
            "gear_location": Known(
                "gear", None, "a code: 0 neutral, 1 drive, 2 reverse, 3 park", needs=_CODED
            ),
            "chassis_gps.altitude": Known("elevation", "m", "height by satellites"),
            "chassis_gps.latitude": Known("latitude", "deg", GNSS),
            "chassis_gps.longitude": Known("longitude", "deg", GNSS),
        },
    ),
    (
        (*_APOLLO, "control_msgs", "apollo_control_msgs"),
        "ControlCommand",
        {
            "throttle": _asked("engine_command", "percent"),
            "brake": _asked("brake_command", "percent"),
            "speed": _asked("speed", "m/s"),
            "acceleration": _asked("acceleration", "m/s^2"),
        },
    ),
    # Dataspeed
    (_MKZ, "ThrottleReport", _dataspeed("engine_command", 0.65, "0.15 released to 0.80 pressed")),
    (_MKZ, "BrakeReport", _dataspeed("brake_command", 0.35, "0.15 released to 0.50 pressed")),
    (
        _FCA,
        "ThrottleReport",
        {
            "pedal_output": Known("engine_command", None, "what the pedal's wire carries"),
            "pedal_input": Known("engine_command", None, "the driver's pedal", Role.DRIVER),
            "pedal_cmd": Known("engine_command", None, "the requested pedal", Role.COMMANDED),
        },
    ),
    (
        _FCA,
        "BrakeReport",
        {
            "pedal_output": Known("brake_command", None, "what the pedal's wire carries"),
            "pedal_input": Known("brake_command", None, "the driver's pedal", Role.DRIVER),
            "pedal_cmd": Known("brake_command", None, "the requested pedal", Role.COMMANDED),
        },
    ),
    (_DATASPEED, "SteeringReport", {"speed": _speed("what the vehicle reports")}),
    (_DATASPEED, "WheelSpeedReport", dict.fromkeys(_SIDES, _WHEEL)),
    (
        _DATASPEED,
        "GearReport",
        {
            "state.gear": Known(
                "gear", None, "a code: 1 park, 2 reverse, 3 neutral, 4 drive, 5 low", needs=_CODED
            ),
            "cmd.gear": Known("gear", None, "the requested gear", Role.COMMANDED),
        },
    ),
    (
        _DATASPEED,
        "ThrottleInfoReport",
        {
            "throttle_pc": Known("engine_command", None, "accelerator pedal", Role.DRIVER),
            "engine_rpm": Known("engine_speed", "rpm", "what the vehicle reports"),
        },
    ),
    (
        _DATASPEED,
        "BrakeInfoReport",
        {"accel_over_ground": Known("acceleration", "m/s^2", "what the vehicle reports")},
    ),
    (("ds_dbw_msgs",), "ThrottleReport", _percent("engine_command")),
    (
        ("ds_dbw_msgs",),
        "BrakeReport",
        {
            "pressure_output": Known("brake_command", "bar", "brake pressure"),
            **_percent("brake_command"),
            "pressure_input": Known("brake_command", "bar", "the driver's pressure", Role.DRIVER),
            "pressure_cmd": Known("brake_command", "bar", "a request", Role.COMMANDED),
        },
    ),
    (
        ("ds_dbw_msgs",),
        "VehicleVelocity",
        {
            "vehicle_velocity_brake": _speed("by the brake controller"),
            "vehicle_velocity_propulsion": _speed("by the powertrain"),
        },
    ),
    (("ds_dbw_msgs",), "WheelSpeeds", dict.fromkeys(_SIDES, _WHEEL)),
    (
        ("ds_dbw_msgs",),
        "PropulsionInfo",
        {
            "engine_torque_actual": Known("engine_torque", "N m", "what the engine reports"),
            "engine_torque_request": Known("engine_command", "N m", "a request", Role.COMMANDED),
        },
    ),
    # PACMod
    (_PACMOD, "VehicleSpeedRpt", {"vehicle_speed": _speed("what the vehicle reports")}),
    (
        _PACMOD,
        "WheelSpeedRpt",
        {
            **{f"{side}_wheel_speed": _WHEEL for side in _SIDES},
            **{f"axle_{k}_{side}_wheel_speed": _WHEEL for k in (1, 2) for side in ("left", "right")},
        },
    ),
    (
        _PACMOD,
        "SystemRptFloat",
        {
            **_pacmod("output", Role.MEASURED, "what is put out"),
            **_pacmod("manual_input", Role.DRIVER, "what the driver demands"),
            **_pacmod("command", Role.COMMANDED, "the requested value"),
        },
    ),
    (_PACMOD, "SystemCmdFloat", _pacmod("command", Role.COMMANDED, "the requested value")),
    (
        _PACMOD,
        "LinearAccelRpt",
        {"longitudinal_accel": Known("acceleration", "m/s^2", "what the vehicle reports")},
    ),
    (_PACMOD, "EngineRpt", _ENGINE),
    (_PACMOD, "EngineAuxRpt", _ENGINE),
    (_PACMOD, "BrakeAuxRpt", {"brake_pressure": Known("brake_command", None, "brake pressure")}),
)

MESSAGE_TYPES: dict[str, dict[str, tuple[Known, ...]]] = {
    f"{package}/msg/{name}": {
        path: known if isinstance(known, tuple) else (known,) for path, known in fields.items()
    }
    for packages, name, fields in _TABLE
    for package in packages
}
