"""How long `deeptruck-model compare` takes for two hours of driving: two recordings of an hour each.

python benchmarks/bench_compare.py

CPU time of the whole command, in a process of its own; and that of `deeptruck-model coverage`, which reads
the same two bags.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

import harness

from deeptruck_model import trucks
from deeptruck_model.recordings import write_bag
from deeptruck_model.trucks import driving_cycles

HOURS, REPEATS = 1.0, 3
CONSOLE_SCRIPT = "from deeptruck_model.cli import main; main()"


def cpu_s(*arguments: str) -> float:
    """CPU seconds of one command."""
    before = harness.children_cpu_s()
    subprocess.run([sys.executable, "-c", CONSOLE_SCRIPT, *arguments], check=True, capture_output=True)
    return harness.children_cpu_s() - before


def main() -> None:
    """Print the table and write it to its section of docs/results/speed.md."""
    harness.options(__doc__, {})
    with tempfile.TemporaryDirectory() as work:
        folder = Path(work)
        for k, name in enumerate(("monday", "friday")):
            drive = driving_cycles.drive(trucks.load("trucksim"), hours=HOURS, seed=k)
            write_bag(folder / name, [drive], interface=drive.interface)
        bags = [str(folder / name) for name in ("monday", "friday")]
        times = {}
        for command in ("compare", "coverage"):
            out = str(folder / command)
            runs = [cpu_s(command, *bags, "--out", out, "--overwrite") for _ in range(REPEATS)]
            times[command] = sorted(runs)[REPEATS // 2]
        size = (folder / "compare" / "compare.html").stat().st_size / 1e6
    lines = harness.heading("Two hours side by side")
    lines += [f"Two made-up drives of {HOURS:g} h at 10 Hz. CPU seconds of the whole command, median of"]
    lines += [f"{REPEATS}; the goal is 10.", ""]
    rows = [f"`compare` | {times['compare']:.1f} | {size:.1f}"]
    rows += [f"`coverage`, which reads the same bags | {times['coverage']:.1f} |"]
    harness.store("speed", [*lines, *harness.table("command | CPU, s | page, MB", rows, right=True)])


if __name__ == "__main__":
    main()
