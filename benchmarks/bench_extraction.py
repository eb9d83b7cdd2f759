"""How fast a long bag becomes recordings, and how much memory that takes; how fast a CAN log is decoded.

    python benchmarks/bench_extraction.py [--hours 4] [--rate 100] [--frames 100000] [--keep FOLDER]

Writes a bag of six topics, reads it in a process of its own, decodes a candump log beside python-can's reader
with cantools, prints a table and its section of docs/results/speed.md.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import can
import cantools
import harness
import numpy as np

from deeptruck_model.recordings import Recording, read, write_bag
from deeptruck_model.signals import TruckInterface
from truck_bridge import can_logs, j1939

PGN = 0x03FF_FF00  # of a message to all, within an identifier
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
            "--frames": (100_000, "of the CAN log"),
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
        decoding = measure_decode(Path(scratch), arguments.frames)
    report(found, written, decoding, f"{arguments.hours:g} h at {arguments.rate:g} Hz, 6 topics")


def make_bag(bag: Path, hours: float, rate: float) -> float | None:
    """Write the bag where it is not there yet; messages a second of the writer."""
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
    """Read once in this fresh process."""
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


def measure_decode(scratch: Path, frames: int) -> dict[str, float]:
    """CPU seconds for every signal of a candump log: ours, and python-can with cantools. Least of five, in
    turn.
    """
    log = scratch / "drive.log"
    codec = j1939.load()
    sent = {
        "CCVS1": {"WheelBasedVehicleSpeed": 36.0},
        "EEC1": {"EngineSpeed": 1200.0, "ActualPercentTorque": 40.0, "DriversDemandPercentTorque": 41.0},
        "EEC3": {"NominalFrictionPercentTorque": 10.0},
        "LFE1": {"EngineFuelRate": 36.0},
    }
    lines = [f"{codec[n].can_id(0):08X}#{codec[n].encode(v).hex().upper()}\n" for n, v in sent.items()]
    with log.open("w") as file:
        for k in range(frames):
            file.write(f"({1e9 + k / 400:.6f}) can0 {lines[k % len(lines)]}")
    database = cantools.database.load_file(Path(j1939.__file__).with_name("j1939.dbc"))
    peer = {
        message.frame_id & PGN: message for message in database.messages
    }  # cantools goes by whole identifiers

    def others() -> None:
        with can.LogReader(log) as reader:
            for message in reader:
                peer[message.arbitration_id & PGN].decode(message.data, decode_choices=False)

    seconds: dict[str, float] = {"frames": frames, "decode": np.inf, "peer": np.inf}
    for _ in range(5):
        for name, run in (("decode", lambda: can_logs.decode(log)), ("peer", others)):
            begin = time.process_time()
            run()
            seconds[name] = min(seconds[name], time.process_time() - begin)
    return seconds


def _peak_mib() -> float:
    """High-water mark of this process alone (ru_maxrss would count the parent's)."""
    status = Path("/proc/self/status").read_text()
    return int(status.partition("VmHWM:")[2].split()[0]) / 1024


def report(found: dict[str, float], written: float | None, decoding: dict[str, float], what: str) -> None:
    """Print the table and write it under docs/results."""
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
    rows.append(("decode, frames of candump a CPU second", f"{decoding['frames'] / decoding['decode']:,.0f}"))
    ratio = decoding["decode"] / decoding["peer"]
    rows.append(("decode, CPU time beside python-can with cantools", f"{ratio:.2f}"))
    title = harness.heading("Reading bags", ", one process, one core")
    harness.store("speed", [*title, *harness.table("extraction | ", (f"{a} | {b}" for a, b in rows))])


if __name__ == "__main__":
    main()
