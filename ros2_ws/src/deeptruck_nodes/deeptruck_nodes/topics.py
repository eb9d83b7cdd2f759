"""Definition of every topic: name, type, quality of service, rate, publishers and subscribers.

Nodes, supervisor, layouts and docs/topics.md use these; tests compare the last two with them.
"""

from __future__ import annotations

from dataclasses import dataclass

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import AccelStamped, TwistStamped
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Imu, JointState, Range


def _reliable(depth: int) -> QoSProfile:
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=depth,
        reliability=ReliabilityPolicy.RELIABLE,
        durability=DurabilityPolicy.VOLATILE,
    )


# Reliable everywhere: on one machine it costs nothing and lock-step needs every message. A recorder that
# was held up for seconds catches up from the publisher's history.
CONTROL_QOS = _reliable(1000)
RECORD_QOS = _reliable(5000)
# Best effort: what only watches, and may be slow or stopped, holds up no publisher. A reliable subscription
# never receives a sensor that publishes best effort, as most do; a best-effort one receives both kinds.
BEST_EFFORT_QOS = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=1000,
    reliability=ReliabilityPolicy.BEST_EFFORT,
    durability=DurabilityPolicy.VOLATILE,
)

SOURCES = ("truck_sim", "can_bridge", "replay")


@dataclass(frozen=True)
class Topic:
    """`fields` are the names in a JointState, always in this order; `rate` describes how often it is
    published."""

    name: str
    message: type
    publishers: tuple[str, ...]
    subscribers: tuple[str, ...]
    rate: str
    content: str
    fields: tuple[str, ...] = ()

    @property
    def type_name(self) -> str:
        """The type's name in bags and in the node graph."""
        return f"{self.message.__module__.split('.')[0]}/msg/{self.message.__name__}"


TWIST = Topic(
    "/truck/twist", TwistStamped, SOURCES,
    ("leader", "controller", "recorder"),
    "rate_hz", "twist.linear.x = speed, m/s",
)  # fmt: skip
ACCEL = Topic(
    "/truck/accel", AccelStamped, SOURCES, ("recorder",),
    "rate_hz", "accel.linear.x = acceleration, m/s^2",
)  # fmt: skip
IMU = Topic(
    "/truck/imu", Imu, SOURCES, ("recorder",),
    "rate_hz", "linear_acceleration.x = what an accelerometer reads, m/s^2: dv/dt + g sin(slope)",
)  # fmt: skip
STATUS = Topic(
    "/truck/status", JointState, SOURCES, ("recorder",),
    "simulator step", "what can be seen inside the truck",
    ("fuel_rate", "gear", "engine_speed", "engine_torque"),
)  # fmt: skip
COMMAND = Topic(
    "/truck/command", JointState, ("controller", "replay"),
    ("truck_sim", "can_bridge", "recorder"),
    "every radar sample; in real time at least every 50 ms",
    "the truck interface's units; engaged 1: they drive, as bridge or simulated truck said last; "
    "room and needed_gap, m: how much farther the vehicle ahead is than the shield needs, NaN: not known; "
    "hold_brake: the brake command that the hazard ahead needs, NaN: none; hold_s: s for which that is "
    "assumed and goes on if control is lost; needed_braking, m/s^2: of that hazard, or of this command",
    ("engine_command", "brake_command", "engaged", "room", "needed_gap", "hold_brake", "hold_s",
     "needed_braking"),
)  # fmt: skip
ENGAGED = Topic(
    "/truck/engaged", JointState, SOURCES, ("controller", "recorder"),
    "every 50 ms and on change; every sample of a simulated truck",
    "1: commands are passed on, a simulated truck obeys each; 0: the driver drives; "
    "-1: the bridge brakes, holds or fades by itself",
    ("engaged",),
)  # fmt: skip
ROAD = Topic(
    "/road", JointState, SOURCES, ("controller", "recorder"),
    "simulator step", "grade as rise/run, elevation in m",
    ("grade", "elevation"),
)  # fmt: skip
RADAR_RANGE = Topic(
    "/radar/range", Range, ("leader", "replay"),
    ("controller", "can_bridge", "recorder"),
    "every /truck/twist", "range = gap, m; +inf: nothing detected",
)  # fmt: skip
RADAR_TWIST = Topic(
    "/radar/twist", TwistStamped, ("leader", "replay"), ("controller", "recorder"),
    "every /truck/twist", "twist.linear.x = leader's speed over ground, m/s; NaN: nothing detected",
)  # fmt: skip
LEADER_STATE = Topic(
    "/leader/state", JointState, ("leader", "replay"), ("recorder",),
    "every /truck/twist", "the leader itself, without radar errors: for scoring only",
    ("true_gap", "true_leader_speed"),
)  # fmt: skip
DIAGNOSTICS = Topic(
    "/diagnostics", DiagnosticArray,
    ("truck_sim", "can_bridge", "leader", "controller", "recorder", "replay"),
    ("recorder",),
    "1 Hz a node", "health, refusals, internal states",
)  # fmt: skip
COUNTED = {  # by the controller, on DIAGNOSTICS: how often it began
    "shield_interventions": "the shield acted",
    "full_brakings": "the truck was braked fully",
    "drop_outs": "the radar lost the leader",
}
REPLAY_STATE = Topic(
    "/replay/state", JointState, ("replay",), (), "10 Hz",
    "recorded time, s: where the replay is, and of how much; paused 1; may_seek 0 while a copy is recorded",
    ("position", "duration", "paused", "may_seek"),
)  # fmt: skip
NO_SEEK = "seeking is off while a copy is recorded"
REPLAY_CONTROL = Topic(
    "/replay/control", JointState, ("live_page",), ("replay",), "on request",
    "paused 1 or 0; seek: recorded time to go on from, s; what is left out or NaN stays as it is",
    ("paused", "seek"),
)  # fmt: skip
SENSORS = (RADAR_RANGE.name, RADAR_TWIST.name)  # may be published by a device that is no node of the run
CLOCK = Topic("/clock", Clock, ("truck_sim", "replay"), (), "every step", "lock-step and replay only")

TOPICS: dict[str, Topic] = {
    topic.name: topic
    for topic in (
        TWIST, ACCEL, IMU, STATUS, COMMAND, ENGAGED, ROAD, RADAR_RANGE, RADAR_TWIST, LEADER_STATE,
        DIAGNOSTICS, CLOCK, REPLAY_STATE, REPLAY_CONTROL,
    )
}  # fmt: skip

RECORDED: tuple[str, ...] = tuple(name for name, topic in TOPICS.items() if "recorder" in topic.subscribers)


def quality(topic: Topic, usual: QoSProfile, peers: tuple[str, ...]) -> QoSProfile:
    """Quality of a subscription: best effort for a sensor that no node of this run publishes."""
    outside = topic.name in SENSORS and not set(topic.publishers) & set(peers)
    return BEST_EFFORT_QOS if outside else usual


def expected_subscribers(topic: Topic, peers: tuple[str, ...]) -> int:
    """Number of nodes in this run that listen to a topic; a publisher is ready once that many have
    matched."""
    return sum(peer in topic.subscribers for peer in peers)
