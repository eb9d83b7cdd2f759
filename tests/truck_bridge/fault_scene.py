"""Bridge and ECU emulator, each a process, and a witness of what they say on the bus."""

from __future__ import annotations

import math
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

import can

from truck_bridge import vehicles
from truck_bridge.vehicles import Vehicle

BRIDGE = Path(__file__).with_name("bridge_process.py")
SLACK = 0.010  # of the witness's own clock and scheduling


@dataclass
class Scene:
    """Two processes on a channel, and what was received there."""

    vehicle: Vehicle
    channel: str
    bridge: subprocess.Popen[str]
    truck: subprocess.Popen[str]
    witness: can.BusABC
    received: list[tuple[float, int, bytes]] = field(default_factory=list)

    def listen(self, seconds: float, until: Callable[[float, int, bytes], bool] | None = None) -> bool:
        """Hear for so long, or until a frame answers the question."""
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0:
            message = self.witness.recv(left)
            if message is None:
                continue
            entry = (time.monotonic(), message.arbitration_id, bytes(message.data))
            self.received.append(entry)
            if until is not None and until(*entry):
                return True
        return False

    def demands(self, axis: str) -> list[tuple[float, float]]:
        """Time and demand of an axis as received; NaN for a frame that hands back."""
        message = self.vehicle.transmitted[axis]
        found = []
        for at, can_id, data in self.received:
            if can_id == message.axis.can_id:
                word = int.from_bytes(data, "little")
                value = message.axis.demand.read(word)
                back = word & ((1 << 56) - 1) == message.axis.release
                found.append((at, math.nan if back or value is None else value))
        return found

    def engaged(self, within: float = 30.0) -> bool:
        """Wait for the first demand."""
        engine = self.vehicle.transmitted["engine"].axis
        mask = (1 << 56) - 1

        def demanding(at: float, can_id: int, data: bytes) -> bool:
            return can_id == engine.can_id and int.from_bytes(data, "little") & mask != engine.release

        return self.listen(within, demanding)


@contextmanager
def scene(name: str, driver: str = "", engine_percent: float = 40.0) -> Iterator[Scene]:
    """A truck at 15 m/s and a bridge; both ended, whatever happens."""
    vehicle, channel = vehicles.load(name), f"{os.getpid()}-{time.monotonic_ns()}"
    witness = can.Bus(interface="loopback", channel=channel)
    command = engine_percent / 100 * (1950 if name == "trucksim" else 100)
    emulator = [sys.executable, "-m", "truck_bridge.emulator", "--vehicle", name, "--channel", channel]
    emulator += ["--speed", "15", *(["--driver", driver] if driver else [])]
    truck = subprocess.Popen(emulator, stdout=subprocess.DEVNULL, text=True)
    bridge = subprocess.Popen([sys.executable, str(BRIDGE), name, channel, str(command)], text=True)
    try:
        yield Scene(vehicle, channel, bridge, truck, witness)
    finally:
        for process in (bridge, truck):
            process.kill()
            process.wait()
        witness.shutdown()


def first_release(scene: Scene, since: float) -> float:
    """s from `since` to the first engine frame that hands back; NaN where none came."""
    released = [at for at, demand in scene.demands("engine") if at >= since and math.isnan(demand)]
    return released[0] - since if released else math.nan


def only_releases(scene: Scene, since: float) -> list[str]:
    """Once handed back, nothing is demanded."""
    late = [demand for at, demand in scene.demands("engine") if at >= since and not math.isnan(demand)]
    return ["a demand left after control was lost"] if late else []


def limits_kept(scene: Scene) -> list[str]:
    """Only listed frames of ours, inside the envelope, without a step."""
    table = scene.vehicle.table
    listed = {axis.can_id for axis in table.axes} | set(table.always)
    ours = {can_id for _, can_id, _ in scene.received if can_id & 0xFF == table.address}
    broken = ["an unlisted frame left"] if ours - listed else []
    for axis in table.axes:
        demands = [demand for _, demand in scene.demands(axis.name)]
        numbers = [d for d in demands if not math.isnan(d)]
        if any(not min(axis.limits.low) - 1e-6 <= d <= max(axis.limits.high) + 1e-6 for d in numbers):
            broken.append(f"{axis.name} out of limits")
        largest = axis.limits.rate * 2 * axis.period_s + 2 * axis.demand.scale
        if any(abs(b - a) > largest for a, b in pairwise(demands)):
            broken.append(f"{axis.name} stepped")
    return broken
