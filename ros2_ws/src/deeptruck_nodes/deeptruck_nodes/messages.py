"""Converts between numbers and ROS messages; no other module fills or reads a message."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import AccelStamped, TwistStamped
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Imu, JointState, Range

SECOND = 1_000_000_000  # ns

LEVELS = {"ok": DiagnosticStatus.OK, "warn": DiagnosticStatus.WARN, "error": DiagnosticStatus.ERROR}


def time_message(stamp: int) -> Time:
    """Nanoseconds as a message."""
    return Time(sec=stamp // SECOND, nanosec=stamp % SECOND)


def nanoseconds(time: Time) -> int:
    """Inverse of time_message."""
    return int(time.sec) * SECOND + int(time.nanosec)


def clock(stamp: int) -> Clock:
    return Clock(clock=time_message(stamp))


def twist(stamp: int, speed: float, frame: str) -> TwistStamped:
    """A speed along x of the named frame, m/s."""
    message = TwistStamped()
    message.header.stamp = time_message(stamp)
    message.header.frame_id = frame
    message.twist.linear.x = float(speed)
    return message


def accel(stamp: int, acceleration: float) -> AccelStamped:
    """An acceleration along x of the truck, m/s^2."""
    message = AccelStamped()
    message.header.stamp = time_message(stamp)
    message.header.frame_id = "truck"
    message.accel.linear.x = float(acceleration)
    return message


def imu(stamp: int, specific_force: float) -> Imu:
    """What an accelerometer along x of the truck reads, m/s^2, gravity in it (REP 145); it measures nothing
    else."""
    message = Imu()
    message.header.stamp = time_message(stamp)
    message.header.frame_id = "truck"
    message.linear_acceleration.x = float(specific_force)
    message.orientation_covariance[0] = message.angular_velocity_covariance[0] = -1.0
    return message


def accelerations(stamp: int, x: float, y: float, z: float) -> AccelStamped:
    """Three accelerations in one message, m/s^2; docs/topics.md defines each."""
    message = accel(stamp, x)
    message.accel.linear.y, message.accel.linear.z = float(y), float(z)
    return message


def scalars(stamp: int, names: Sequence[str], values: Mapping[str, float]) -> JointState:
    """A stamped vector of named numbers; a name without a value gets NaN."""
    message = JointState(name=list(names))
    message.header.stamp = time_message(stamp)
    message.position = [float(values.get(name, float("nan"))) for name in names]
    return message


def read_scalars(message: JointState) -> dict[str, float]:
    """Inverse of scalars; surplus names or positions are ignored."""
    return dict(zip(message.name, message.position, strict=False))


def numbers(message: TwistStamped | AccelStamped | Imu | JointState | Range) -> dict[str, float]:
    """The numbers along x in a message, by their field paths in a topic map."""
    if isinstance(message, JointState):
        return {f"position[name={name}]": value for name, value in read_scalars(message).items()}
    if isinstance(message, Range):
        return {"range": message.range}
    if isinstance(message, AccelStamped):
        return {"accel.linear.x": message.accel.linear.x}
    if isinstance(message, Imu):
        return {"linear_acceleration.x": message.linear_acceleration.x}
    return {"twist.linear.x": message.twist.linear.x}


def detected(message: Range) -> float:
    """A radar's distance, m; NaN if it detected nothing or the distance is outside its range (REP 117)."""
    return message.range if message.min_range <= message.range <= message.max_range else math.nan


def radar_range(stamp: int, gap: float, reach: float) -> Range:
    """A radar's distance, m; +inf is 'nothing detected' (REP 117)."""
    message = Range(radiation_type=Range.INFRARED, field_of_view=0.3, min_range=0.5, max_range=float(reach))
    message.header.stamp = time_message(stamp)
    message.header.frame_id = "radar"
    message.range = float(gap)
    return message


def diagnostics(
    stamp: int, node: str, level: str, says: str, values: Mapping[str, object]
) -> DiagnosticArray:
    """One status of one node; level is 'ok', 'warn' or 'error'."""
    status = DiagnosticStatus(level=LEVELS[level], name=f"deeptruck: {node}", message=says, hardware_id=node)
    status.values = [KeyValue(key=key, value=_text(value)) for key, value in values.items()]
    message = DiagnosticArray(status=[status])
    message.header.stamp = time_message(stamp)
    return message


def _text(value: object) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)
