"""What is done to a process or its clock, and what has to follow; frames are bent in lock-step."""

from __future__ import annotations

import math
import os
import signal
import time
from collections.abc import Callable

from fault_scene import SLACK, Scene, first_fall, first_release, only_releases

from truck_bridge.j1939.address_claim import name as j1939_name


def driver_brakes(scene: Scene) -> tuple[list[str], float]:
    pedal = scene.vehicle.codec["EBC1"].signals["BrakePedalPosition"]
    switch = scene.vehicle.codec["CCVS1"].signals["BrakeSwitch"]

    def pressed(at: float, can_id: int, data: bytes) -> bool:
        word, key = int.from_bytes(data, "little"), can_id & 0x03FF_FFFF
        by_pedal = key == 0xF0010B and pedal.value((word >> pedal.start) & pedal.mask) > 3
        return by_pedal or (key == 0xFEF100 and (word >> switch.start) & switch.mask == 1)

    if not scene.listen(20.0, pressed):
        return ["the driver never braked"], math.nan
    told = scene.received[-1][0]
    scene.listen(1.0)
    reaction = first_release(scene, told)
    slow = [] if reaction <= 0.020 + SLACK else [f"first release after {reaction * 1e3:.0f} ms"]
    return slow + only_releases(scene, told + 0.020 + SLACK), reaction


def _faded(scene: Scene, since: float, within: float) -> tuple[list[str], float]:
    scene.listen(3.0)
    reaction = first_fall(scene, since)
    broken = [] if reaction <= within + SLACK else [f"graded release began after {reaction * 1e3:.0f} ms"]
    return broken + only_releases(scene, since + within + 1.5), reaction


def controller_mute(scene: Scene) -> tuple[list[str], float]:
    since = time.monotonic()
    scene.tell("mute")
    return _faded(scene, since, 0.2)


def bridge_stopped(scene: Scene) -> tuple[list[str], float]:
    """SIGSTOP for a second: the truck times out; on waking the bridge hands back and demands nothing."""
    os.kill(scene.bridge.pid, signal.SIGSTOP)
    scene.listen(1.0)
    woken = time.monotonic()
    os.kill(scene.bridge.pid, signal.SIGCONT)
    scene.listen(1.0)
    return only_releases(scene, woken), first_release(scene, woken)


def bridge_killed(scene: Scene) -> tuple[list[str], float]:
    """kill -9: nothing leaves; the engine's own time-out ends the demand."""
    since = time.monotonic()
    os.kill(scene.bridge.pid, signal.SIGKILL)
    scene.listen(1.0)
    codec = scene.vehicle.codec
    end = [
        codec.decode(i, d) for at, i, d in scene.received if at > since + 0.6 and i & 0x3FFFFFF == 0xF00400
    ]
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
    return only_releases(scene, woken), first_release(scene, woken)


def clock_jumps(seconds: float) -> Callable[[Scene], tuple[list[str], float]]:
    """The bridge's monotonic clock jumps, which no clock should do."""

    def begin(scene: Scene) -> tuple[list[str], float]:
        since = time.monotonic()
        scene.tell(f"clock {seconds}")
        scene.listen(1.5)
        reaction = first_release(scene, since)
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


def address_taken(scene: Scene) -> tuple[list[str], float]:
    since = time.monotonic()
    scene.send(0x18EEFF00 | scene.vehicle.address, j1939_name(0))
    scene.listen(1.0)
    late = {can_id & 0xFF for at, can_id, _ in scene.received if at > since + 0.02 + SLACK}
    return (["it spoke after losing its address"] if scene.vehicle.address in late else []), math.nan


def ended_in_order(scene: Scene) -> tuple[list[str], float]:
    since = time.monotonic()
    scene.tell("quit")
    scene.listen(1.5)
    releases = [d for at, d in scene.demands("engine") if at >= since and math.isnan(d)]
    broken = [] if len(releases) == 4 else [f"{len(releases)} release frames instead of 4"]
    return broken + only_releases(scene, since + 0.1), first_release(scene, since)


FAULTS: dict[str, Callable[[Scene], tuple[list[str], float]]] = {
    "driver brakes": driver_brakes,
    "controller mute": controller_mute,
    "SIGSTOP bridge": bridge_stopped,
    "kill -9 bridge": bridge_killed,
    "all paused 0.5 s": all_paused,
    "clock 30 s on": clock_jumps(30.0),
    "clock 30 s back": clock_jumps(-30.0),
    "kill -9 truck": truck_killed,
    "SIGSTOP truck": truck_stopped,
    "address taken": address_taken,
    "ended in order": ended_in_order,
}
