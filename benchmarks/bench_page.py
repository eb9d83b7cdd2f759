"""The live page: the cores its process takes at 100 Hz, and what it does to the age of a command.

    python benchmarks/bench_page.py [--seconds 20] [--repeats 5]

Six processes (start script, truck_sim, leader, controller, recorder, and the page) with the physics truck and
the ACC baseline. Runs with and without the page take turns, so that a busy machine is as busy for both; a
viewer that only reads hears every batch. Prints a table and writes its section of docs/results/speed.md.
"""

from __future__ import annotations

import argparse
import itertools
import os
import subprocess
import sys
import tempfile
import threading
import time
import urllib.request
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pages
from bench_node_graph import PRIORITY, ROOT, TRUCK, cpu
from deeptruck_nodes.messages import SECOND
from deeptruck_nodes.recorder import header_stamp

from deeptruck_model.recordings.bag_source import BagSource


@dataclass(frozen=True)
class Run:
    """Ages in ms, the page's cores (0 without one), and how busy the other processes kept the machine."""

    p50: float
    p99: float
    page: float
    others: float


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--seconds", type=float, default=20.0, help="of each run")
    parser.add_argument("--repeats", type=int, default=5, help="pairs of runs")
    arguments = parser.parse_args()
    os.environ.setdefault("ROS_DOMAIN_ID", "98")
    runs = []
    for k in range(2 * arguments.repeats + 1):  # without, with, without, ..., without
        with tempfile.TemporaryDirectory() as scratch:
            runs.append(measured(Path(scratch), arguments.seconds, page=k % 2 == 1))
        print(f"{'with' if k % 2 else 'without'}: {runs[-1]}", flush=True)
    report(runs, arguments)


def measured(folder: Path, seconds: float, *, page: bool) -> Run:
    """One run at 100 Hz; its first and last second are left out."""
    argv = [sys.executable, ROOT / "ros2_ws" / "start_simulation.py", *TRUCK, "--record", folder / "bag"]
    argv += ["--runs", folder / "runs", "--rate", 100, "--duration", seconds, *(["--page"] if page else [])]
    process = subprocess.Popen([str(a) for a in argv], stdout=subprocess.PIPE, text=True)
    try:
        address = driving(process)
        if page:
            threading.Thread(target=view, args=(address,), daemon=True).start()
        time.sleep(1.0)
        used, others = load(process.pid, seconds - 2.0)
        process.wait(60)
    finally:
        process.kill()
    with BagSource(folder / "bag") as bag:
        received = [(at, at - header_stamp(data)) for _, at, data in bag.messages({"/truck/command"})]
    ages = [age / 1e6 for at, age in received if at > received[0][0] + SECOND]
    p50, p99 = np.percentile(ages, [50, 99])
    return Run(float(p50), float(p99), used, others)


def driving(process: subprocess.Popen[str]) -> str:
    """The page's address, when the run is driving."""
    address = ""
    assert process.stdout is not None
    while not (line := process.stdout.readline()).startswith("ready"):
        if line.startswith("page: "):
            address = line.split()[1]
        if not line:
            sys.exit(process.wait())
    return address


def view(address: str) -> None:
    """Read the page, then its stream to the end."""
    with urllib.request.urlopen(address) as page:
        page.read()
    with urllib.request.urlopen(f"{address}events") as stream:
        while stream.read1(1 << 16):
            pass


def load(supervisor: int, seconds: float) -> tuple[float, float]:
    """Cores of the page's process, and of whatever does not belong to the run."""
    nodes = children(supervisor)
    page = [pid for pid, name in nodes.items() if "live_page" in name]
    begun, of_page, of_run, of_all = time.monotonic(), cpu(page), cpu([supervisor, *nodes]), busy()
    time.sleep(seconds)
    taken = time.monotonic() - begun
    run = cpu([supervisor, *nodes]) - of_run
    return (cpu(page) - of_page) / taken, (busy() - of_all - run) / taken


def children(pid: int) -> dict[int, str]:
    """Command lines of a process's children."""
    listed = subprocess.run(
        ["ps", "--ppid", str(pid), "-o", "pid=,args="], capture_output=True, text=True, check=True
    )
    lines = (line.strip().partition(" ") for line in listed.stdout.splitlines())
    return {int(number): name for number, _, name in lines}


def busy() -> float:
    """CPU seconds that all processors have been busy."""
    fields = [int(x) for x in Path("/proc/stat").read_text().splitlines()[0].split()[1:9]]
    return (sum(fields) - fields[3] - fields[4]) / os.sysconf("SC_CLK_TCK")


def report(runs: list[Run], arguments: argparse.Namespace) -> None:
    """Print the table and write it under docs/results; a ratio is to the mean of the runs beside it."""
    without, with_page = runs[::2], runs[1::2]
    pairs = list(itertools.pairwise(without))
    page = [run.page for run in with_page]
    rows = [("CPU of the page's process at 100 Hz, one viewer", told(page, "cores"), "< 0.15 cores")]
    for name in ("p50", "p99"):
        ages = [getattr(run, name) for run in with_page]
        before = [(getattr(a, name), getattr(b, name)) for a, b in pairs]
        ratios = [age / np.mean(two) for age, two in zip(ages, before, strict=True)]
        rows.append((f"age of a command, {name}, without the page", told([x[0] for x in before], "ms"), ""))
        rows.append((f"age, {name}, with the page", told(ages, "ms"), ""))
        goal = "< 1.10" if name == "p99" else ""
        rows.append((f"age, {name}, with to without", told(ratios), goal))
        rows.append((f"age, {name}, without to the one before without", told([b / a for a, b in before]), ""))
    text = "\n".join(
        ["| what | measured | goal |", "| --- | --- | --- |", *(f"| {' | '.join(r)} |" for r in rows)]
    )
    others = told([run.others for run in runs], "cores")
    machine = f"{os.cpu_count()} cores{PRIORITY}; other processes kept {others} of them busy"
    command = f"python benchmarks/bench_page.py --seconds {arguments.seconds:g} --repeats {arguments.repeats}"
    print(text, machine, sep="\n")
    pages.store("speed", f"# Live page\n\n`{command}`, {machine}.\n\n{text}\n\n{NOTE}")


def told(values: list[float], unit: str = "") -> str:
    """The median, and the smallest and largest."""
    middle, low, high = np.median(values), min(values), max(values)
    return f"{middle:.2f}{unit and ' '}{unit} ({low:.2f} to {high:.2f})"


NOTE = """\
The page has the lower priority, and no real-time priority where the run has it.

Median of the runs, with the smallest and the largest in brackets. Runs with and without the page take turns.
A ratio is that of one run to the mean of its two neighbours. The last row of each kind says how much two runs
without the page differ: less than that is no effect. The age is that of
[the node graph](#node-graph). The viewer reads and draws nothing; a browser on the same machine needs
its own share of it."""


if __name__ == "__main__":
    main()
