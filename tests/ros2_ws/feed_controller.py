"""Run by test_controller: a truck and a radar at 5 Hz, of which the named topics fall silent after 2 s.

Prints when commands came.
"""

import json
import sys
import time

import rclpy
from deeptruck_nodes import messages
from deeptruck_nodes.topics import COMMAND, CONTROL_QOS, RADAR_RANGE, RADAR_TWIST, ROAD, TWIST
from sensor_msgs.msg import JointState

DRIVES, LISTENS, PERIOD = 2.0, 4.0, 0.2  # s

rclpy.init()
node = rclpy.create_node("leader")
out = {
    t.name: node.create_publisher(t.message, t.name, CONTROL_QOS)
    for t in (TWIST, ROAD, RADAR_RANGE, RADAR_TWIST)
}
came: list[float] = []


def on_command(message: JointState) -> None:
    assert all(value == value for value in message.position)
    came.append(time.monotonic() - begun)


node.create_subscription(COMMAND.message, COMMAND.name, on_command, CONTROL_QOS)
while not all(publisher.get_subscription_count() for publisher in out.values()):
    rclpy.spin_once(node, timeout_sec=0.1)
begun = fed = time.monotonic()
due = begun
while (now := time.monotonic()) < begun + LISTENS:
    if now >= due:
        stamp, due = time.time_ns(), due + PERIOD
        sample = {
            TWIST.name: messages.twist(stamp, 20.0, "truck"),
            ROAD.name: messages.scalars(stamp, ROAD.fields, {"grade": 0.0, "elevation": 0.0}),
            RADAR_RANGE.name: messages.radar_range(stamp, 40.0, 200.0),
            RADAR_TWIST.name: messages.twist(stamp, 20.0, "radar"),
        }
        driving = now < begun + DRIVES
        fed = now - begun if driving else fed
        for name, message in sample.items():
            if driving or name not in sys.argv[1:]:
                out[name].publish(message)
    rclpy.spin_once(node, timeout_sec=0.01)
print(json.dumps({"fed": fed, "came": came}))
