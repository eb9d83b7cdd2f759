"""A bridge in a process of its own, as the node has it, for runs over real processes.

`python bridge_process.py VEHICLE CHANNEL ENGINE BRAKE`: arms, commands every 20 ms, engages when it may, and
does what the lines on stdin say: `mute` (the controller), `clock SECONDS` (by which its clock jumps), `quit`.
Prints `engaged` and then the reason when control is lost.
"""

from __future__ import annotations

import json
import os
import sys
import threading
import time

import can

from truck_bridge import vehicles
from truck_bridge.bridge import Bridge

PERIOD = 0.02  # s, of the controller


class Process:
    """The controller and the person around a bridge."""

    def __init__(self, vehicle: str, channel: str, engine: float, brake: float) -> None:
        self.bus = can.Bus(interface="loopback", channel=channel)
        self.bridge = Bridge(vehicles.load(vehicle), self.bus)
        self.engine, self.brake = engine, brake
        self.stop = threading.Event()
        self.muted = self.engaged = self.lost = False
        self.said: list[str] = []

    def run(self) -> None:
        """Until `quit`."""
        threading.Thread(target=lambda: self.said.extend(iter(sys.stdin.readline, "")), daemon=True).start()
        self.bridge.arm(time.monotonic())
        priority = {"priority": int(os.environ.get("BRIDGE_PRIORITY", "0"))}
        thread = threading.Thread(target=self.bridge.run, args=(self.stop,), kwargs=priority)
        thread.start()
        while not self.stop.is_set():
            for line in [self.said.pop(0) for _ in range(len(self.said))]:
                self.obey(*line.split())
            self.turn(time.monotonic())
            time.sleep(PERIOD)
        thread.join()

    def obey(self, word: str, *values: str) -> None:
        """One line from stdin."""
        value = values[0] if values else ""
        match word:
            case "mute":
                self.muted = True
            case "clock":
                true = time.monotonic
                time.monotonic = lambda: true() + float(value)
            case "quit":
                self.stop.set()

    def turn(self, now: float) -> None:
        """Command, ask for control until it was given once, and say what became of it."""
        bridge = self.bridge
        if not self.muted:
            bridge.command(self.engine, self.brake, now, engaged=bridge.engaged)
        if not self.engaged and bridge.engage(now, person=True, lead_vehicle=True) == ():
            self.engaged = True
            print("engaged", flush=True)
        if self.engaged and not self.lost and bridge.status.reason:
            self.lost = True
            print(bridge.status.reason, flush=True)


def main() -> None:
    """See the module."""
    process = Process(sys.argv[1], sys.argv[2], float(sys.argv[3]), float(sys.argv[4]))
    process.run()
    status = process.bridge.status
    print(json.dumps({"refusals": status.refusals, "losses": status.losses}), flush=True)


if __name__ == "__main__":
    main()
