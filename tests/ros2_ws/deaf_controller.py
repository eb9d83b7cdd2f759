"""Run by test_vehicle: a controller that asks for 20 % torque at 50 Hz and never hears that it drives."""

import sys
import time

import rclpy

from deeptruck_nodes import messages
from deeptruck_nodes.topics import COMMAND, CONTROL_QOS, RADAR_RANGE

PERIOD = 0.02  # s

rclpy.init()
node = rclpy.create_node("controller")
command, radar = (node.create_publisher(t.message, t.name, CONTROL_QOS) for t in (COMMAND, RADAR_RANGE))
until = time.monotonic() + float(sys.argv[1])
while time.monotonic() < until:
    stamp = time.time_ns()
    values = {"engine_command": 390.0, "brake_command": 0.0, "engaged": 0.0}
    command.publish(messages.scalars(stamp, COMMAND.fields, values))
    radar.publish(messages.radar_range(stamp, 40.0, 200.0))
    time.sleep(PERIOD)
