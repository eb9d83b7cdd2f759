"""How long it takes until a wrong path, a wrong option or a misfit of units is reported, and how long
`--help` takes.

    python benchmarks/bench_errors.py [--repeats 3]

Every command runs in a process of its own, with input that it must refuse; the table has the shortest of some
runs. The limits, 1 s to the error on an idle machine and 0.5 s of CPU for `--help`, are aims: nothing is
asserted. Writes its section of docs/results/speed.md.
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

from deeptruck_model import trucks
from deeptruck_model.recordings import Recording, write_bag
from deeptruck_model.signals import TruckInterface

PATIENCE_S = 120.0  # of one run, which takes a second: longer is a hang
SCRIPTS = harness.ROOT / "ros2_ws"
REFUSED = (
    "deeptruck-model import none.csv --columns none.yaml --out out",
    "deeptruck-model coverage none --out out",
    "deeptruck-model train percent drive --out out",
    "deeptruck-model sweep drive --out out --set speed=3",
    "deeptruck-model evaluate truck:trucksim percent --out out",
    "deeptruck-model calibrate truck:trucksim drive --out out",
    "deeptruck-model mismatch --simulator truck:trucksim --recordings percent --out out",
    "deeptruck-model apply none --out out",
    "deeptruck-cacc train --simulator none --out out",
    "deeptruck-cacc evaluate none --simulator truck:trucksim --out out",
    "truck-bridge decode none.log --vehicle none --out out.csv",
    "start_simulation.py --simulator truck:trucksim --policy none --record out",
    "start_vehicle.py --vehicle none --record out",
    "replay_recording.py none",
)
HELP = (
    "deeptruck-model --help",
    "deeptruck-model train --help",
    "deeptruck-cacc --help",
    "truck-bridge --help",
    "start_simulation.py --help",
    "start_vehicle.py --help",
    "replay_recording.py --help",
)


def main() -> None:
    """Print the tables and write them to a section of docs/results/speed.md."""
    repeats = (3, "runs of each command, of which the least counts")
    arguments = harness.options(__doc__, {"--repeats": repeats})
    with tempfile.TemporaryDirectory() as name:
        prepare(Path(name))
        tables = [
            [row(command, Path(name), arguments.repeats) for command in commands]
            for commands in (REFUSED, HELP)
        ]
    load = os.getloadavg()[0] / (os.cpu_count() or 1)
    lines = harness.heading("Time to the error", "; each command in a process of its own.")
    lines += [SAYS.format(load=load)]
    for heads, rows in zip(("command | exit code | lines", "`--help` | exit code"), tables, strict=True):
        lines += ["", *harness.table(f"{heads} | s | CPU s", rows, right=True)]
    harness.store("speed", [*lines, "", BELOW])


def prepare(folder: Path) -> None:
    """A bag that fits `trucksim`, and one in other units and without a grade."""
    fits = trucks.load("trucksim").interface
    for name, interface in (
        ("drive", fits),
        ("percent", TruckInterface("percent", engine_unit="percent", grade=False)),
    ):
        channels = {n: np.zeros(600) for n in (*interface.y, *interface.u, *interface.w)}
        write_bag(folder / name, [Recording(name, 0.1, channels, interface)], interface=interface)


def row(command: str, folder: Path, repeats: int) -> str:
    """A command's exit code, number of lines of its error (not of `--help`) and shortest times (s), run in
    `folder`."""
    program, *words = command.split()
    script = SCRIPTS / program if program.endswith(".py") else Path(sys.executable).parent / program
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    times = []
    for _ in range(repeats):
        cpu, begin = harness.children_cpu_s(), time.perf_counter()
        done = subprocess.run(
            [sys.executable, str(script), *words],
            cwd=folder, env=environment, capture_output=True, text=True, check=False,
            timeout=PATIENCE_S,
        )  # fmt: skip
        times.append((time.perf_counter() - begin, harness.children_cpu_s() - cpu))
    wall_s, cpu_s = np.min(times, axis=0)
    lines = "" if command in HELP else f" | {len(done.stderr.strip().splitlines())}"
    return f"`{command}` | {done.returncode}{lines} | {wall_s:.2f} | {cpu_s:.2f}"


SAYS = """Of its runs the least, start and imports included. The load was {load:.1f} processes a core: CPU
time is the fairer of the two. The aims on an idle machine: 1 s to an error, 0.5 s of CPU for `--help`."""
BELOW = """`none` is not there, `drive` is a bag that fits, `percent` has its engine command in percent and
no grade."""


if __name__ == "__main__":
    main()
