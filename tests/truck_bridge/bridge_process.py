"""A bridge in a process of its own, as the node has it, for runs over real processes.

`python bridge_process.py VEHICLE CHANNEL ENGINE`: arms, commands the engine in the vehicle's unit
every 20 ms and engages once, when it may. Runs until it is killed.
"""

from __future__ import annotations

import os
import sys
import threading
import time

import can

from truck_bridge import vehicles
from truck_bridge.bridge import Bridge

PERIOD = 0.02  # s, of the controller


def main() -> None:
    """See the module."""
    name, channel, engine = sys.argv[1:]
    bridge = Bridge(vehicles.load(name), can.Bus(interface="loopback", channel=channel))
    bridge.arm(time.monotonic())
    priority = {"priority": int(os.environ.get("BRIDGE_PRIORITY", "0"))}
    threading.Thread(target=bridge.run, args=(threading.Event(),), kwargs=priority, daemon=True).start()
    engaged = False
    while True:
        now = time.monotonic()
        bridge.command(float(engine), 0.0, now, engaged=bridge.engaged)
        engaged = engaged or bridge.engage(now, person=True, lead_vehicle=True) == ()
        time.sleep(PERIOD)


if __name__ == "__main__":
    main()
