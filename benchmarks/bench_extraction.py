"""How fast a long bag is read into recordings, and how much memory that takes.

    python benchmarks/bench_extraction.py [--hours 4] [--rate 100] [--keep FOLDER]

Writes a bag of six topics, reads it in a process of its own, prints a table and writes its section of
docs/results/speed.md.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import harness
import numpy as np

from deeptruck_core.signals import TruckInterface
from deeptruck_model.recordings import Recording, read, write_bag

CHANNELS = {  # on /truck/twist, accel, status, command, /road and /radar/range
    "speed": 20.0,
    "acceleration": 0.5,
    "fuel_rate": 8.0,
    "gear": 9.0,
    "engine_speed": 130.0,
    "engine_torque": 900.0,
    "engine_command": 900.0,
    "brake_command": 5.0,
    "grade": 0.02,
    "gap": 40.0,
}


def main() -> None:
    arguments = harness.options(
        __doc__,
        {
            "--hours": 4.0,
            "--rate": (100.0, "Hz of every topic"),
            "--keep": (Path, "folder to keep the bag in (and find it again)"),
            "--measure": (Path, harness.HIDDEN),
        },
    )
    if arguments.measure:
        print(json.dumps(measure(arguments.measure)))
        return
    with tempfile.TemporaryDirectory() as scratch:
        bag = (arguments.keep or Path(scratch)) / f"bag_{arguments.hours:g}h_{arguments.rate:g}hz"
        written = make_bag(bag, arguments.hours, arguments.rate)
        command = [sys.executable, __file__, "--measure", str(bag)]
        found = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
    report(found, written, f"{arguments.hours:g} h at {arguments.rate:g} Hz, 6 topics")


def make_bag(bag: Path, hours: float, rate: float) -> float | None:
    """Write the bag unless it exists; returns the messages per second of the writer."""
    if bag.exists():
        return None
    rng = np.random.default_rng(0)
    count = int(hours * 3600 * rate)
    channels = {name: level * rng.uniform(0.9, 1.1, count) for name, level in CHANNELS.items()}
    interface = TruckInterface("bench")
    begin = time.perf_counter()
    write_bag(bag, [Recording(bag.name, 1.0 / rate, channels, interface)], interface=interface)
    return 6 * count / (time.perf_counter() - begin)


def measure(bag: Path) -> dict[str, float]:
    """Read the bag once in this new process."""
    before = _peak_mib()
    begin, cpu = time.perf_counter(), time.process_time()
    recordings = read(bag)
    seconds, cpu = time.perf_counter() - begin, time.process_time() - cpu
    drive = sum(len(r) * r.dt for r in recordings)
    size = sum(file.stat().st_size for file in bag.iterdir()) / 2**20
    return {
        "seconds": seconds,
        "cpu": cpu,
        "drive_s": drive,
        "before": before,
        "peak": _peak_mib(),
        "bag_mib": size,
    }


def _peak_mib() -> float:
    """Peak resident memory of this process, MiB; ru_maxrss would include the parent's."""
    status = Path("/proc/self/status").read_text()
    return int(status.partition("VmHWM:")[2].split()[0]) / 1024


def report(found: dict[str, float], written: float | None, what: str) -> None:
    """Print the table and write it to its section."""
    messages = int(what.split(" Hz")[0].split()[-1]) * found["drive_s"] * 6
    rows = [
        ("bag", f"{what}, {found['bag_mib']:.0f} MiB"),
        ("messages", f"{messages:,.0f}"),
        ("read and resampled in", f"{found['seconds']:.1f} s"),
        ("messages a second", f"{messages / found['seconds']:,.0f}"),
        ("messages a CPU second", f"{messages / found['cpu']:,.0f}"),
        ("times faster than real time", f"{found['drive_s'] / found['seconds']:,.0f}"),
        ("peak memory (after imports)", f"{found['peak']:.0f} MiB ({found['before']:.0f} MiB)"),
    ]
    if written:
        rows.append(("messages a second, written", f"{written:,.0f}"))
    title = harness.heading("Reading bags", ", one process, one core")
    harness.store("speed", [*title, *harness.table("extraction | ", (f"{a} | {b}" for a, b in rows))])


if __name__ == "__main__":
    main()
