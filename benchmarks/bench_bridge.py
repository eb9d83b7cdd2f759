"""Codec compared with cantools, loopback bus, period jitter of TSC1 and brake, driver override to release.

`python benchmarks/bench_bridge.py [--seconds 20] [--overrides 5] [--priority 0]` prints a table and writes it
to its section of docs/results/speed.md. Bridge and emulator run as processes of their own; this process
listens on the bus.
"""

from __future__ import annotations

import math
import os
import sys
import time
from collections.abc import Callable
from importlib import resources

import can
import cantools.database
import harness
import numpy as np

from truck_bridge import j1939
from truck_bridge.vehicles import Vehicle

sys.path.insert(0, str(harness.ROOT / "tests" / "truck_bridge"))
import fault_scene

FRAME = bytes.fromhex("219B9BDD2F000F9B")
CALLS = 20_000
DRIVER_AT = 6.0  # s after the emulator's start


def per_second(call: Callable[[], object]) -> float:
    return CALLS / min(harness.cpu_s(lambda: [call() for _ in range(CALLS)]))


def codec_rows() -> list[str]:
    """Our codec and cantools on the same EEC1 frame, in the same run."""
    text = resources.files("truck_bridge.j1939").joinpath("j1939.dbc").read_text()
    theirs = cantools.database.load_string(text, "dbc").get_message_by_name("EEC1")
    ours = j1939.load()["EEC1"]
    values = {key: value for key, value in ours.decode(FRAME).values.items() if not math.isnan(value)}
    whole = {**values, "StarterMode": 0}
    rows = []
    for what, mine, other in (
        ("decode", lambda: ours.decode(FRAME), lambda: theirs.decode(FRAME, decode_choices=False)),
        ("encode", lambda: ours.encode(whole), lambda: theirs.encode(whole, padding=True)),
    ):
        a, b = per_second(mine), per_second(other)
        text = f"{a / 1e3:.0f} k/s; cantools {b / 1e3:.0f} k/s; ratio {a / b:.2f}"
        rows.append(f"codec {what}, EEC1 | {text}")
    return rows


def bus_row(frames: int = 2000) -> str:
    """One way through the loopback bus, 1 kHz, inside one process."""
    channel = f"bench-{os.getpid()}"
    with (
        can.Bus(interface="loopback", channel=channel) as a,
        can.Bus(interface="loopback", channel=channel) as b,
    ):
        taken = []
        for _ in range(frames):
            start = time.perf_counter()
            a.send(can.Message(arbitration_id=0x0CF00400, data=FRAME))
            b.recv(1.0)
            taken.append(time.perf_counter() - start)
            time.sleep(0.001)
    p50, p99 = np.percentile(taken, [50, 99]) * 1e3
    return f"loopback bus, send to receive | p50 {p50:.2f} ms, p99 {p99:.2f} ms"


def jitter_rows(name: str, seconds: float) -> list[str]:
    """Message periods as received on the bus."""
    with fault_scene.scene(name) as stage:
        if not stage.engaged():
            return [f"{name}: periods | did not engage"]
        stage.listen(0.5)
        stage.received.clear()
        stage.listen(seconds)
        rows = []
        for axis, period in (("engine", 0.02), ("brake", 0.02)):
            wanted = stage.vehicle.transmitted[axis].axis.can_id
            times = np.array([at for at, can_id, _ in stage.received if can_id == wanted])
            late = np.abs(np.diff(times) - period) * 1e3
            message = stage.vehicle.transmitted[axis].layout.name
            p50, p99 = np.percentile(late, [50, 99])
            worst = f"p50 {p50:.2f}, p99 {p99:.2f}, max {late.max():.2f} ms"
            text = f"{len(times)} frames, off 20 ms by {worst}"
            rows.append(f"{name}: {message} every 20 ms | {text}")
        return rows


def pressed(vehicle: Vehicle, can_id: int, data: bytes) -> bool:
    """Whether a frame shows the driver's foot on the brake."""
    word, key = int.from_bytes(data, "little"), can_id & 0x03FF_FFFF
    pedal, switch = (
        vehicle.codec["EBC1"].signals["BrakePedalPosition"],
        vehicle.codec["CCVS1"].signals["BrakeSwitch"],
    )
    by_pedal = key == 0xF0010B and pedal.value((word >> pedal.start) & pedal.mask) > 3
    return by_pedal or (key == 0xFEF100 and (word >> switch.start) & switch.mask == 1)


def override_s(name: str) -> float:
    """On the bus, from the first frame that shows the driver's foot to the first that hands back. NaN where
    neither came, or control had ended before."""
    with fault_scene.scene(name, f"{DRIVER_AT}:brake_pedal=40") as stage:
        if not stage.engaged() or not stage.listen(20.0, lambda at, *frame: pressed(stage.vehicle, *frame)):
            return math.nan
        since = stage.received[-1][0]
        if math.isnan(stage.demands("engine")[-1][1]):
            return math.nan
        stage.listen(1.0)
        return fault_scene.first_release(stage, since)


def override_row(runs: int) -> str:
    """How soon the driver has the truck back."""
    times = [1e3 * taken for taken in (override_s("volvo") for _ in range(runs)) if not math.isnan(taken)]
    late = sum(time > 20 for time in times)
    text = f"{len(times)} runs, p50 {np.median(times):.1f} ms, max {max(times):.1f} ms, {late} above 20 ms"
    return f"driver override to first release frame | {text}"


def main() -> None:
    priority = (0, "SCHED_FIFO priority of bridge and witness")
    options = harness.options(__doc__, {"--seconds": 20.0, "--overrides": 5, "--priority": priority})
    if options.priority:
        os.environ["BRIDGE_PRIORITY"] = str(options.priority)
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(options.priority))
    rows = [*codec_rows(), bus_row()]
    for name in ("trucksim", "volvo"):
        rows += jitter_rows(name, options.seconds)
    rows.append(override_row(options.overrides))
    how = " with real-time priority" * bool(options.priority)
    lines = harness.heading(
        f"CAN bridge{how}", f"; load average {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores at the end."
    )
    harness.store("speed", [*lines, *harness.table("what | measured", rows)])


if __name__ == "__main__":
    main()
