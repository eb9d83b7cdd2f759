"""The live page: the CPU that its process uses at 100 Hz, and its influence on the age of a command.

    python benchmarks/bench_page.py [--seconds 20] [--repeats 5]

Six processes (start script, truck_sim, leader, controller, recorder, and the page) with the physics truck and
the ACC baseline. Runs with and without the page alternate, so that a busy machine is as busy for both; a
viewer receives every batch. Prints a table and writes its section of docs/results/speed.md.
"""

from __future__ import annotations

import itertools
import os
import tempfile
import threading
import time
import urllib.request
from dataclasses import dataclass
from pathlib import Path

import harness
import numpy as np
from bench_node_graph import ages, start, until


@dataclass(frozen=True)
class Run:
    """Ages in ms, the cores that the page uses (0 without one), and those that other processes use."""

    p50: float
    p99: float
    page: float
    others: float


def main() -> None:
    seconds, repeats = (20.0, "of each run"), (5, "pairs of runs")
    arguments = harness.options(__doc__, {"--seconds": seconds, "--repeats": repeats})
    os.environ.setdefault("ROS_DOMAIN_ID", "98")
    runs = []
    for k in range(2 * arguments.repeats + 1):  # without, with, without, ..., without
        with tempfile.TemporaryDirectory() as scratch:
            runs.append(measured(Path(scratch), arguments.seconds, page=k % 2 == 1))
        print(f"{'with' if k % 2 else 'without'}: {runs[-1]}", flush=True)
    report(runs)


def measured(folder: Path, seconds: float, *, page: bool) -> Run:
    """One run at 100 Hz, without its first and last second."""
    process = start(folder, "--rate", 100, "--duration", seconds, *(["--page"] if page else []))
    try:
        if page:
            address = until(process, "page: ").split()[1]
            threading.Thread(target=view, args=(address,), daemon=True).start()
        until(process, "ready")
        time.sleep(1.0)
        used, others = load(process.pid, seconds - 2.0)
        process.wait(60)
    finally:
        process.kill()
    p50, p99 = np.percentile(ages(folder / "bag"), [50, 99])
    return Run(float(p50), float(p99), used, others)


def view(address: str) -> None:
    """Read the page, then its stream to the end."""
    with urllib.request.urlopen(address) as page:
        page.read()
    with urllib.request.urlopen(f"{address}events") as stream:
        while stream.read1(1 << 16):
            pass


def load(supervisor: int, seconds: float) -> tuple[float, float]:
    """Cores used by the page's process, and by all processes that do not belong to the run."""
    nodes, of = harness.children(supervisor), harness.processes_cpu_s
    page = [pid for pid, name in nodes.items() if "live_page" in name]
    begun, of_page, of_run, of_all = time.monotonic(), of(page), of([supervisor, *nodes]), busy()
    time.sleep(seconds)
    taken = time.monotonic() - begun
    run = of([supervisor, *nodes]) - of_run
    return (of(page) - of_page) / taken, (busy() - of_all - run) / taken


def busy() -> float:
    """CPU seconds used on all processors."""
    fields = [int(x) for x in Path("/proc/stat").read_text().splitlines()[0].split()[1:9]]
    return (sum(fields) - fields[3] - fields[4]) / harness.TICK


def report(runs: list[Run]) -> None:
    """Store the table; each ratio is to the mean of the runs before and after."""
    without, with_page = runs[::2], runs[1::2]
    pairs = list(itertools.pairwise(without))
    page = spread([run.page for run in with_page], "cores")
    rows = [f"CPU of the page's process at 100 Hz, one viewer | {page} | < 0.15 cores"]
    for name in ("p50", "p99"):
        ages = [getattr(run, name) for run in with_page]
        before = [(getattr(a, name), getattr(b, name)) for a, b in pairs]
        ratios = [age / np.mean(two) for age, two in zip(ages, before, strict=True)]
        goal = "< 1.10" if name == "p99" else ""
        rows.append(f"age of a command, {name}, without the page | {spread([x[0] for x in before], 'ms')} |")
        rows.append(f"age, {name}, with the page | {spread(ages, 'ms')} |")
        rows.append(f"age, {name}, with to without | {spread(ratios)} | {goal}")
        rows.append(
            f"age, {name}, without to the one before without | {spread([b / a for a, b in before])} |"
        )
    others = spread([run.others for run in runs], "cores")
    facts = f", {harness.machine()}; other processes kept {others} of them busy."
    lines = [*harness.heading("Live page", facts), *harness.table("what | measured | goal", rows)]
    harness.store("speed", [*lines, "", NOTE])


def spread(values: list[float], unit: str = "") -> str:
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
