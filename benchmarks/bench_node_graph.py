"""The node graph: age of a command and CPU at 100 Hz in real time, and the speed of lock-step.

    python benchmarks/bench_node_graph.py [--seconds 30] [--simulated 600]

Five processes (start script, truck_sim, leader, controller, recorder) with the physics truck and the ACC
baseline. The age of a command is the time from the tick of the simulator that it answers until the recorder
receives it: simulator, radar, controller and one more hop. Prints a table and writes its section of
docs/results/speed.md.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import harness
import numpy as np

from deeptruck_model.recordings.bag_source import BagSource
from deeptruck_nodes.messages import SECOND
from deeptruck_nodes.recorder import header_stamp

TRUCK = ("--simulator", "truck:trucksim", "--policy", "baseline:acc", "--leader", "sine")


def main() -> None:
    seconds, simulated = (30.0, "of real time"), (600.0, "seconds of lock-step")
    arguments = harness.options(__doc__, {"--seconds": seconds, "--simulated": simulated})
    os.environ.setdefault("ROS_DOMAIN_ID", "99")
    load = os.getloadavg()[0]
    with tempfile.TemporaryDirectory() as scratch:
        live, fast = Path(scratch, "live"), Path(scratch, "fast")
        rows = [*real_time(live, arguments.seconds), *lock_step(fast, arguments.simulated)]
    lines = harness.heading("Node graph", f", {harness.machine(load)}.")
    harness.store("speed", [*lines, *harness.table("what | measured | goal", rows), "", NOTE])


def start(folder: Path, *arguments: object) -> subprocess.Popen[str]:
    """Start a simulation and record it to `folder`/bag."""
    argv = [sys.executable, harness.ROOT / "ros2_ws" / "start_simulation.py", *TRUCK]
    argv += ["--record", folder / "bag", "--runs", folder / "runs", *arguments]
    return subprocess.Popen([str(a) for a in argv], stdout=subprocess.PIPE, text=True)


def until(process: subprocess.Popen[str], word: str) -> str:
    """The first line of a simulation's output that begins with `word`."""
    assert process.stdout is not None
    while not (line := process.stdout.readline()).startswith(word):
        if not line:
            sys.exit(process.wait())
    return line


def ages(bag: Path) -> list[float]:
    """Age of each command after the first second, ms, from the simulator's tick to the recorder."""
    with BagSource(bag) as source:
        received = [(at, at - header_stamp(data)) for _, at, data in source.messages({"/truck/command"})]
    return [age / 1e6 for at, age in received if at > received[0][0] + SECOND]


def real_time(folder: Path, seconds: float) -> list[str]:
    """Ages and CPU at 100 Hz, without the first second after matching."""
    process = start(folder, "--rate", 100, "--duration", seconds)
    until(process, "ready")
    time.sleep(1.0)
    pids = [process.pid, *harness.children(process.pid)]
    before, begun = harness.processes_cpu_s(pids), time.monotonic()
    time.sleep(seconds - 2.0)
    used = (harness.processes_cpu_s(pids) - before) / (time.monotonic() - begun)
    process.wait()
    found = ages(folder / "bag")
    p50, p99, most = np.percentile(found, [50, 99, 100])
    return [
        f"age of {len(found)} commands at 100 Hz, p50 | {p50:.2f} ms |",
        f"age, p99 | {p99:.2f} ms | < 10 ms",
        f"age, largest | {most:.2f} ms |",
        f"CPU of {len(pids)} processes | {used:.2f} cores | < 0.5 cores",
    ]


def lock_step(folder: Path, simulated: float) -> list[str]:
    """Simulated seconds per second, from the start until every process has ended."""
    process = start(folder, "--lockstep", "--duration", simulated)
    until(process, "ready")
    begun = time.monotonic()
    process.wait()
    taken = time.monotonic() - begun
    with BagSource(folder / "bag") as bag:
        count = sum(1 for _ in bag.messages({"/truck/command"}))
    if count < (steps := round(simulated * 10)):
        sys.exit(f"lock-step lost commands: {count} of {steps} recorded")
    speed = f"{simulated / taken:.1f} x real time"
    return [f"lock-step at 10 Hz, {simulated:g} s with recorder | {speed} | >= 15 x"]


NOTE = """\
Age: from the simulator's tick until the recorder has the command that answers it (simulator, radar,
controller, recorder), after the first second. Lock-step: one handshake for each 0.1 s step of the truck; the
time contains the orderly end of all processes."""


if __name__ == "__main__":
    main()
