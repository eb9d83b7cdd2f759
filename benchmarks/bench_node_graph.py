"""The node graph: age of a command and CPU at 100 Hz in real time, and the speed of lock-step.

    python benchmarks/bench_node_graph.py [--seconds 30] [--simulated 600]

Five processes (start script, truck_sim, leader, controller, recorder) with the physics truck and the ACC
baseline. The age is the time from the tick of the simulator that a command answers until the recorder has
that command: simulator, radar, controller and one hop more. Prints a table and writes
its section of docs/results/speed.md.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import pages
from deeptruck_nodes.messages import SECOND
from deeptruck_nodes.recorder import header_stamp

from deeptruck_model.recordings.bag_source import BagSource

ROOT = Path(__file__).parents[1]
PRIORITY = ", real-time priority (chrt -f 1)" if os.sched_getscheduler(0) == os.SCHED_FIFO else ""
TRUCK = ("--simulator", "truck:trucksim", "--policy", "baseline:acc", "--leader", "sine")
TICK = os.sysconf("SC_CLK_TCK")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--seconds", type=float, default=30.0, help="of real time")
    parser.add_argument("--simulated", type=float, default=600.0, help="seconds of lock-step")
    arguments = parser.parse_args()
    os.environ.setdefault("ROS_DOMAIN_ID", "99")
    load = os.getloadavg()[0]
    with tempfile.TemporaryDirectory() as scratch:
        rows = [*real_time(Path(scratch), arguments.seconds), *lock_step(Path(scratch), arguments.simulated)]
    report(rows, f"{os.cpu_count()} cores, load average {load:.1f} before{PRIORITY}")


def start(folder: Path, name: str, *arguments: object) -> subprocess.Popen[str]:
    """Start a simulation and return when it is driving."""
    argv = [sys.executable, ROOT / "ros2_ws" / "start_simulation.py", *TRUCK, "--record", folder / name]
    argv += ["--runs", folder / f"runs-{name}", *arguments]
    process = subprocess.Popen([str(a) for a in argv], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    while not (line := process.stdout.readline()).startswith("ready"):
        if not line:
            sys.exit(process.wait())
    return process


def real_time(folder: Path, seconds: float) -> list[tuple[str, str, str]]:
    """Ages and CPU at 100 Hz; the first second after matching is left out."""
    process = start(folder, "bag", "--rate", 100, "--duration", seconds)
    time.sleep(1.0)
    pids = [process.pid, *children(process.pid)]
    before, begun = cpu(pids), time.monotonic()
    time.sleep(seconds - 2.0)
    used = (cpu(pids) - before) / (time.monotonic() - begun)
    process.wait()
    ages = []
    with BagSource(folder / "bag") as bag:
        received = [(at, at - header_stamp(data)) for _, at, data in bag.messages({"/truck/command"})]
        ages = [age / 1e6 for at, age in received if at > received[0][0] + SECOND]
    p50, p99, most = np.percentile(ages, [50, 99, 100])
    return [
        (f"age of {len(ages)} commands at 100 Hz, p50", f"{p50:.2f} ms", ""),
        ("age, p99", f"{p99:.2f} ms", "< 10 ms"),
        ("age, largest", f"{most:.2f} ms", ""),
        (f"CPU of {len(pids)} processes", f"{used:.2f} cores", "< 0.5 cores"),
    ]


def lock_step(folder: Path, simulated: float) -> list[tuple[str, str, str]]:
    """Simulated seconds a second, from go to the end of every process."""
    process, begun = start(folder, "fast", "--lockstep", "--duration", simulated), time.monotonic()
    process.wait()
    taken = time.monotonic() - begun
    with BagSource(folder / "fast") as bag:
        count = sum(1 for _ in bag.messages({"/truck/command"}))
    steps = round(simulated * 10)
    if count < steps:
        sys.exit(f"lock-step lost commands: {count} of {steps} recorded")
    return [
        (
            f"lock-step at 10 Hz, {simulated:g} s with recorder",
            f"{simulated / taken:.1f} x real time",
            ">= 15 x",
        )
    ]


def children(pid: int) -> list[int]:
    listed = subprocess.run(
        ["ps", "--ppid", str(pid), "-o", "pid="], capture_output=True, text=True, check=True
    )
    return [int(line) for line in listed.stdout.split()]


def cpu(pids: list[int]) -> float:
    """CPU seconds the processes have used."""
    total = 0
    for pid in pids:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
        total += int(fields[11]) + int(fields[12])
    return total / TICK


def report(rows: list[tuple[str, str, str]], machine: str) -> None:
    """Print the table and write it under docs/results."""
    lines = [
        "| what | measured | goal |",
        "| --- | --- | --- |",
        *(f"| {a} | {b} | {c} |" for a, b, c in rows),
    ]
    text = "\n".join(lines)
    print(text)
    pages.store(
        "speed", f"# Node graph\n\n`python benchmarks/bench_node_graph.py`, {machine}.\n\n{text}\n\n{NOTE}"
    )


NOTE = """\
Age: from the simulator's tick until the recorder has the command that answers it (simulator, radar,
controller, recorder), after the first second. Lock-step: one handshake for each 0.1 s step of the truck; the
time contains the orderly end of all processes."""


if __name__ == "__main__":
    main()
