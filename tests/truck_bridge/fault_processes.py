"""Faults on real processes in real time: bridge and ECU emulator each a process, this one the witness.
The nodes of the whole graph: `tests/ros2_ws/fault_nodes.py`.

`python tests/truck_bridge/fault_processes.py --runs 50`. What is judged is what the witness heard on the bus.
"""

from __future__ import annotations

import argparse
import math
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

import can
import numpy as np
from fault_wire import FAULTS as WIRE_FAULTS

from truck_bridge import vehicles
from truck_bridge.j1939.address_claim import name as j1939_name
from truck_bridge.vehicles import Vehicle

BRIDGE = Path(__file__).with_name("bridge_process.py")
DRIVER_AT = 6.0  # s after the emulator's start
SLACK = 0.010  # of the witness's own clock and scheduling


@dataclass
class Scene:
    """Two processes on a channel, and what was heard there."""

    vehicle: Vehicle
    channel: str
    bridge: subprocess.Popen[str]
    truck: subprocess.Popen[str]
    witness: can.BusABC
    heard: list[tuple[float, int, bytes]] = field(default_factory=list)

    def listen(self, seconds: float, until: Callable[[float, int, bytes], bool] | None = None) -> bool:
        """Hear for so long, or until a frame answers the question."""
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0:
            message = self.witness.recv(left)
            if message is None:
                continue
            entry = (time.monotonic(), message.arbitration_id, bytes(message.data))
            self.heard.append(entry)
            if until is not None and until(*entry):
                return True
        return False

    def send(self, can_id: int, data: bytes) -> None:
        self.witness.send(can.Message(arbitration_id=can_id, data=data, is_extended_id=True))

    def tell(self, line: str) -> None:
        assert self.bridge.stdin is not None
        self.bridge.stdin.write(line + "\n")
        self.bridge.stdin.flush()

    def demands(self, axis: str) -> list[tuple[float, float]]:
        """Time and demand of an axis as heard; NaN for a frame that hands back."""
        message = self.vehicle.transmitted[axis]
        found = []
        for at, can_id, data in self.heard:
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
    emulator = [sys.executable, "-m", "truck_bridge.ecu_emulator", "--vehicle", name, "--channel", channel]
    truck = subprocess.Popen(
        [*emulator, "--speed", "15", "--driver", driver], stdout=subprocess.DEVNULL, text=True
    )
    bridge = subprocess.Popen(
        [sys.executable, str(BRIDGE), name, channel, str(command), "0"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        yield Scene(vehicle, channel, bridge, truck, witness)
    finally:
        for process in (bridge, truck):
            process.kill()
            process.wait()
        witness.shutdown()


@dataclass(frozen=True)
class Outcome:
    fault: str
    vehicle: str
    broken: tuple[str, ...]
    reaction_s: float  # to the first frame that hands back, or first fading demand; NaN where none comes
    spoilt: bool = False  # control ended before the fault: the machine paused the bridge for over 100 ms


def _first_release(scene: Scene, since: float) -> float:
    released = [at for at, demand in scene.demands("engine") if at >= since and math.isnan(demand)]
    return released[0] - since if released else math.nan


def _first_fall(scene: Scene, since: float) -> float:
    """To the first engine demand below the one before the fault."""
    before = [demand for at, demand in scene.demands("engine") if at < since]
    for at, demand in scene.demands("engine"):
        if at >= since and (math.isnan(demand) or demand < before[-1] - 0.5):
            return at - since
    return math.nan


def only_releases(scene: Scene, since: float) -> list[str]:
    """Once handed back, nothing is demanded."""
    late = [demand for at, demand in scene.demands("engine") if at >= since and not math.isnan(demand)]
    return ["a demand left after control was lost"] if late else []


def driver_brakes(scene: Scene) -> tuple[list[str], float]:
    pedal = scene.vehicle.codec["EBC1"].signals["BrakePedalPosition"]
    switch = scene.vehicle.codec["CCVS1"].signals["BrakeSwitch"]

    def pressed(at: float, can_id: int, data: bytes) -> bool:
        word, key = int.from_bytes(data, "little"), can_id & 0x03FF_FFFF
        by_pedal = key == 0xF0010B and pedal.value((word >> pedal.start) & pedal.mask) > 3
        return by_pedal or (key == 0xFEF100 and (word >> switch.start) & switch.mask == 1)

    if not scene.listen(20.0, pressed):
        return ["the driver never braked"], math.nan
    told = scene.heard[-1][0]
    scene.listen(1.0)
    reaction = _first_release(scene, told)
    slow = [] if reaction <= 0.020 + SLACK else [f"first release after {reaction * 1e3:.0f} ms"]
    return slow + only_releases(scene, told + 0.020 + SLACK), reaction


def _faded(scene: Scene, since: float, within: float) -> tuple[list[str], float]:
    scene.listen(3.0)
    reaction = _first_fall(scene, since)
    broken = [] if reaction <= within + SLACK else [f"graded release began after {reaction * 1e3:.0f} ms"]
    return broken + only_releases(scene, since + within + 1.5), reaction


def controller_mute(scene: Scene) -> tuple[list[str], float]:
    since = time.monotonic()
    scene.tell("mute")
    return _faded(scene, since, 0.2)


def controller_nan(scene: Scene) -> tuple[list[str], float]:
    since = time.monotonic()
    scene.tell("nan")
    return _faded(scene, since, 0.1)


def bridge_stopped(scene: Scene) -> tuple[list[str], float]:
    """SIGSTOP for a second: the truck times out; on waking the bridge hands back and demands nothing."""
    os.kill(scene.bridge.pid, signal.SIGSTOP)
    scene.listen(1.0)
    woken = time.monotonic()
    os.kill(scene.bridge.pid, signal.SIGCONT)
    scene.listen(1.0)
    return only_releases(scene, woken), _first_release(scene, woken)


def bridge_killed(scene: Scene) -> tuple[list[str], float]:
    """kill -9: nothing leaves; the engine's own time-out ends the demand."""
    since = time.monotonic()
    os.kill(scene.bridge.pid, signal.SIGKILL)
    scene.listen(1.0)
    codec = scene.vehicle.codec
    end = [codec.decode(i, d) for at, i, d in scene.heard if at > since + 0.6 and i & 0x3FFFFFF == 0xF00400]
    held = [e for e in end if e and e.values["EngineControllingAddress"] == scene.vehicle.address]
    broken = ["the engine obeyed a dead bridge"] if held or not end else []
    return broken + only_releases(scene, since + 0.02 + SLACK), math.nan


def all_paused(scene: Scene) -> tuple[list[str], float]:
    """Half a second in which neither bridge nor truck gets the processor."""
    for process in (scene.bridge, scene.truck):
        os.kill(process.pid, signal.SIGSTOP)
    scene.listen(0.5)
    woken = time.monotonic()
    for process in (scene.truck, scene.bridge):
        os.kill(process.pid, signal.SIGCONT)
    scene.listen(1.0)
    return only_releases(scene, woken), _first_release(scene, woken)


def bad_wire(fault: str) -> Callable[[Scene], tuple[list[str], float]]:
    """Every second frame to the bridge is harmed for 1.5 s. Judged: the limits, and what follows a loss."""

    def begin(scene: Scene) -> tuple[list[str], float]:
        since = time.monotonic()
        scene.tell(f"wire {fault}")
        scene.listen(1.5)
        scene.tell("wire")
        scene.listen(3.0)
        reaction = _first_release(scene, since)
        broken = [] if math.isnan(reaction) else only_releases(scene, since + reaction + 0.001)
        return broken, reaction

    return begin


def clock_jumps(seconds: float) -> Callable[[Scene], tuple[list[str], float]]:
    """The bridge's monotonic clock jumps, which no clock should do."""

    def begin(scene: Scene) -> tuple[list[str], float]:
        since = time.monotonic()
        scene.tell(f"clock {seconds}")
        scene.listen(1.5)
        reaction = _first_release(scene, since)
        slow = [] if reaction <= 0.1 else [f"first release after {reaction * 1e3:.0f} ms"]
        return slow + only_releases(scene, since + 0.1), reaction

    return begin


def truck_killed(scene: Scene) -> tuple[list[str], float]:
    since = time.monotonic()
    os.kill(scene.truck.pid, signal.SIGKILL)
    return _faded(scene, since, 0.12)


def truck_stopped(scene: Scene) -> tuple[list[str], float]:
    since = time.monotonic()
    os.kill(scene.truck.pid, signal.SIGSTOP)
    return _faded(scene, since, 0.12)


def spoofed(scene: Scene) -> tuple[list[str], float]:
    engine = scene.vehicle.transmitted["engine"]
    since = time.monotonic()
    scene.send(engine.axis.can_id & ~0xFF | 0x77, engine.frame(90.0, 0))
    return _faded(scene, since, 0.05)


def flooded(scene: Scene) -> tuple[list[str], float]:
    """Two thousand frames a second of other groups: control goes on or is handed back; limits hold."""
    rng, end = np.random.default_rng(0), time.monotonic() + 1.0
    while time.monotonic() < end:
        for _ in range(10):
            scene.send(0x18FF0000 | int(rng.integers(256)) << 8 | 0xF9, rng.bytes(8))
        scene.listen(0.005)
    return [], math.nan


def address_taken(scene: Scene) -> tuple[list[str], float]:
    since = time.monotonic()
    scene.send(0x18EEFF00 | scene.vehicle.address, j1939_name(0))
    scene.listen(1.0)
    late = {can_id & 0xFF for at, can_id, _ in scene.heard if at > since + 0.02 + SLACK}
    return (["it spoke after losing its address"] if scene.vehicle.address in late else []), math.nan


def ended_in_order(scene: Scene) -> tuple[list[str], float]:
    since = time.monotonic()
    scene.tell("quit")
    scene.listen(1.5)
    releases = [d for at, d in scene.demands("engine") if at >= since and math.isnan(d)]
    broken = [] if len(releases) == 4 else [f"{len(releases)} release frames instead of 4"]
    return broken + only_releases(scene, since + 0.1), _first_release(scene, since)


FAULTS: dict[str, Callable[[Scene], tuple[list[str], float]]] = {
    "driver brakes": driver_brakes,
    "controller mute": controller_mute,
    "controller NaN": controller_nan,
    "SIGSTOP bridge": bridge_stopped,
    "kill -9 bridge": bridge_killed,
    "all paused 0.5 s": all_paused,
    **{f"wire: {fault}": bad_wire(fault) for fault in WIRE_FAULTS},
    "clock 30 s on": clock_jumps(30.0),
    "clock 30 s back": clock_jumps(-30.0),
    "kill -9 truck": truck_killed,
    "SIGSTOP truck": truck_stopped,
    "spoofed TSC1": spoofed,
    "flood": flooded,
    "address taken": address_taken,
    "ended in order": ended_in_order,
}


def limits_kept(scene: Scene) -> list[str]:
    """Only listed frames of ours, inside the envelope, without a step."""
    table = scene.vehicle.table
    listed = {axis.can_id for axis in table.axes} | set(table.always)
    ours = {can_id for _, can_id, _ in scene.heard if can_id & 0xFF == table.address}
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


def play(fault: str, name: str) -> Outcome:
    """One run."""
    driver = f"{DRIVER_AT}:brake_pedal=40" if fault == "driver brakes" else ""
    with scene(name, driver) as stage:
        if not stage.engaged():
            return Outcome(fault, name, ("did not engage",), math.nan)
        stage.listen(1.0)
        if math.isnan(stage.demands("engine")[-1][1]):
            return Outcome(fault, name, (), math.nan, spoilt=True)
        broken, reaction = FAULTS[fault](stage)
        return Outcome(fault, name, tuple(broken + limits_kept(stage)), reaction)


def main() -> int:
    """Run many and say what broke."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=50)
    parser.add_argument("--priority", type=int, default=0, help="SCHED_FIFO priority of bridge and witness")
    options = parser.parse_args()
    if options.priority:  # what a vehicle's computer would give the bridge; a loaded machine is late without
        os.environ["BRIDGE_PRIORITY"] = str(options.priority)
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(options.priority))
    outcomes = []
    for number in range(options.runs):
        fault = list(FAULTS)[number % len(FAULTS)]
        outcomes.append(play(fault, vehicles.NAMES[number // len(FAULTS) % len(vehicles.NAMES)]))
    print(f"{'fault':<18}{'runs':>5}{'reaction p50':>14}{'max':>9}  broken")
    for fault in FAULTS:
        mine = [o for o in outcomes if o.fault == fault]
        times = [o.reaction_s for o in mine if not math.isnan(o.reaction_s)]
        shown = f"{'-':>14}{'-':>9}"
        if times:
            shown = f"{1e3 * np.median(times):>11.0f} ms{1e3 * max(times):>6.0f} ms"
        print(f"{fault:<18}{len(mine):>5}{shown}  {[o.broken for o in mine if o.broken] or 'none'}")
    broken = sum(bool(o.broken) for o in outcomes)
    spoilt = sum(o.spoilt for o in outcomes)
    print(f"{len(outcomes)} runs in real time, {broken} with a broken invariant, {spoilt} spoilt by load")
    print(f"load average {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")
    return 1 if broken else 0


if __name__ == "__main__":
    sys.exit(main())
