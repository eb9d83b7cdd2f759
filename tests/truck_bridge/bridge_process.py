"""A bridge in a process of its own, as the node has it, for runs over real processes.

`python bridge_process.py VEHICLE CHANNEL ENGINE BRAKE`: arms, commands every 20 ms, engages when it may, and
does what the lines on stdin say: `mute` and `speak` (the controller), `nan`, `release`, `quit`. Prints
`engaged` and then the reason when control is lost.
"""

from __future__ import annotations

import json
import math
import os
import sys
import threading
import time

from truck_bridge import vehicles
from truck_bridge.bridge import Bridge
from truck_bridge.bus import open_bus


def main() -> None:
    """Run until `quit`."""
    name, channel, engine, brake = sys.argv[1], sys.argv[2], float(sys.argv[3]), float(sys.argv[4])
    bridge = Bridge(vehicles.load(name), open_bus("loopback", channel))
    stop, said = threading.Event(), []
    threading.Thread(target=lambda: said.extend(iter(sys.stdin.readline, "")), daemon=True).start()
    bridge.arm(time.monotonic())
    priority = int(os.environ.get("BRIDGE_PRIORITY", "0"))
    thread = threading.Thread(target=bridge.run, args=(stop,), kwargs={"priority": priority})
    thread.start()
    muted = engaged = lost = False
    while not stop.is_set():
        now = time.monotonic()
        for line in [said.pop(0) for _ in range(len(said))]:
            match line.strip():
                case "mute":
                    muted = True
                case "speak":
                    muted = False
                case "nan":
                    engine = math.nan
                case "release":
                    bridge.release(now)
                case "quit":
                    stop.set()
        if not muted:
            bridge.command(engine, brake, now, engaged=bridge.engaged)
        if not engaged and bridge.engage(now, person=True, lead_vehicle=True) == ():
            engaged = True
            print("engaged", flush=True)
        if engaged and not lost and bridge.status.reason:
            lost = True
            print(bridge.status.reason, flush=True)
        time.sleep(0.02)
    thread.join()
    print(json.dumps({"refusals": bridge.status.refusals, "losses": bridge.status.losses}), flush=True)


if __name__ == "__main__":
    main()
