"""Run by test_controller: a truck and a radar at 5 Hz, of which the named topics fall silent after 2 s, and a
bridge that says from TOLD[0] to TOLD[1] that it is engaged and is then received no more.

Prints when commands came, and the engaged bit each of them bore. Words beside names of topics: `best_effort`
(the radar), `future` (one sample of the radar after 1 s is stamped an hour ahead), `second` (another node
sends speeds too).
"""

import json
import sys
import time

import rclpy
from sensor_msgs.msg import JointState

from deeptruck_nodes import messages
from deeptruck_nodes.topics import (
    BEST_EFFORT_QOS,
    COMMAND,
    CONTROL_QOS,
    ENGAGED,
    RADAR_RANGE,
    RADAR_TWIST,
    ROAD,
    SENSORS,
    TWIST,
)

DRIVES, LISTENS, PERIOD = 2.0, 4.0, 0.2  # s
TOLD, ENGAGED_PERIOD_S = (0.5, 1.3), 0.05  # s

rclpy.init()
node = rclpy.create_node("leader")
sensed = BEST_EFFORT_QOS if "best_effort" in sys.argv else CONTROL_QOS
out = {
    t.name: node.create_publisher(t.message, t.name, sensed if t.name in SENSORS else CONTROL_QOS)
    for t in (TWIST, ROAD, RADAR_RANGE, RADAR_TWIST, ENGAGED)
}
came: list[float] = []
bits: list[float] = []


def on_command(message: JointState) -> None:
    assert all(value == value for value in message.position[:3])  # the room is unknown where nothing is seen
    bits.append(message.position[COMMAND.fields.index("engaged")])
    came.append(time.monotonic() - begun)


node.create_subscription(COMMAND.message, COMMAND.name, on_command, CONTROL_QOS)
while not all(publisher.get_subscription_count() for publisher in out.values()):
    rclpy.spin_once(node, timeout_sec=0.1)
stranger = rclpy.create_node("stranger") if "second" in sys.argv else None
strange = stranger and stranger.create_publisher(TWIST.message, TWIST.name, CONTROL_QOS)
begun = fed = time.monotonic()
due = begun
tell = begun + TOLD[0]
while (now := time.monotonic()) < begun + LISTENS:
    if now >= due:
        stamp, due = time.time_ns(), due + PERIOD
        late = "future" in sys.argv and now >= begun + 1.0
        seen = stamp + 3_600_000_000_000 * late
        if late:
            sys.argv.remove("future")
        sample = {
            TWIST.name: messages.twist(stamp, 20.0, "truck"),
            ROAD.name: messages.scalars(stamp, ROAD.fields, {"grade": 0.0, "elevation": 0.0}),
            RADAR_RANGE.name: messages.radar_range(seen, 40.0, 200.0),
            RADAR_TWIST.name: messages.twist(seen, 20.0, "radar"),
        }
        driving = now < begun + DRIVES
        fed = now - begun if driving else fed
        for name, message in sample.items():
            if driving or name not in sys.argv[1:]:
                out[name].publish(message)
        if strange and now > begun + 1.0:
            strange.publish(messages.twist(stamp, 10.0, "truck"))
    if tell <= now < begun + TOLD[1]:
        tell += ENGAGED_PERIOD_S
        out[ENGAGED.name].publish(messages.scalars(time.time_ns(), ENGAGED.fields, {"engaged": 1.0}))
    rclpy.spin_once(node, timeout_sec=0.01)
print(json.dumps({"fed": fed, "came": came, "bits": bits, "told": TOLD}))
