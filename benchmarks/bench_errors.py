"""How long it takes until a wrong path, a wrong option or a misfit of units is said, and how long `--help`.

    python benchmarks/bench_errors.py [--repeats 3]

Every command runs in a process of its own, with input that it must refuse; the table has the least of some
runs. The limits, 1 s to the error on an idle machine and 0.5 s of CPU for `--help`, are aims: nothing is
asserted. Writes its section of docs/results/speed.md.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import harness
import numpy as np

from deeptruck_model import trucks
from deeptruck_model.recordings import Recording, write_bag
from deeptruck_model.signals import TruckInterface

SCRIPTS = harness.ROOT / "ros2_ws"
PATIENCE_S = 120.0
REFUSED = (
    "deeptruck-model import none.csv --columns none.yaml --out out",
    "deeptruck-model coverage none --out out",
    "deeptruck-model repair none",
    "deeptruck-model train none --out out",
    "deeptruck-model train percent drive --out out",
    "deeptruck-model train drive --out link",
    "deeptruck-model sweep drive --out out --set speed=3",
    "deeptruck-model evaluate truck:trucksim:mass=-1 none --out out",
    "deeptruck-model evaluate truck:trucksim percent --out out",
    "deeptruck-model evaluate truck:trucksim drive --out drive",
    "deeptruck-model calibrate truck:trucksim drive --out out",
    "deeptruck-model export none --out out.onnx",
    "deeptruck-model experiment field --out drive/metadata.yaml",
    "deeptruck-model mismatch --simulator truck:trucksim --recordings none --out out",
    "deeptruck-model mismatch --simulator truck:trucksim --recordings percent --out out",
    "deeptruck-model mismatch --simulator truck:trucksim --recordings drive --out link",
    "deeptruck-model apply none --out out",
    "deeptruck-model road none --out out",
    "deeptruck-model prove --out link",
    "deeptruck-cacc train --simulator truck:none --out out",
    "deeptruck-cacc train --simulator none --out out",
    "deeptruck-cacc evaluate none --simulator truck:trucksim --out out",
    "deeptruck-cacc export none --out out.onnx",
    "truck-bridge decode none.log --vehicle none --out out.csv",
    "truck-bridge check none.log --vehicle none",
    "truck-bridge convert none.log out.asc",
    "start_simulation.py --simulator truck:none --record out",
    "start_simulation.py --simulator truck:trucksim --policy none --record out",
    "start_vehicle.py --vehicle none --record out",
    "replay_recording.py none",
)
HELP = (
    "deeptruck-model --help",
    "deeptruck-model train --help",
    "deeptruck-model mismatch --help",
    "deeptruck-cacc --help",
    "deeptruck-cacc train --help",
    "truck-bridge --help",
    "truck-bridge decode --help",
    "start_simulation.py --help",
    "start_vehicle.py --help",
    "replay_recording.py --help",
)


@dataclass(frozen=True)
class Run:
    """What one command said, and what it took: s of the clock and of CPU (user and system)."""

    command: str
    code: int | None  # None: it had said nothing after PATIENCE_S
    says: str
    wall_s: float
    cpu_s: float


def main() -> None:
    repeats = (3, "runs of each command, of which the least counts")
    only = ("", "only commands that hold these words")
    arguments = harness.options(__doc__, {"--repeats": repeats, "--only": only})
    with tempfile.TemporaryDirectory() as name:
        prepare(Path(name))
        wanted = [command for command in (*REFUSED, *HELP) if arguments.only in command]
        found = {command: least(command, Path(name), arguments.repeats) for command in wanted}
    lines = written(*([found[c] for c in some if c in found] for some in (REFUSED, HELP)))
    if arguments.only:
        print("\n".join(lines))
    else:
        harness.store("speed", lines)


def prepare(folder: Path) -> None:
    """A bag that fits `trucksim`, one in other units and without a grade, and a symbolic link."""
    fits = trucks.load("trucksim").interface
    for name, interface in (
        ("drive", fits),
        ("percent", TruckInterface("percent", engine_unit="percent", grade=False)),
    ):
        channels = {n: np.zeros(600) for n in (*interface.y, *interface.u, *interface.w)}
        write_bag(folder / name, [Recording(name, 0.1, channels, interface)], interface=interface)
    (folder / "link").symlink_to(folder)


def least(command: str, folder: Path, repeats: int) -> Run:
    """The quickest of some runs."""
    return min((once(command, folder) for _ in range(repeats)), key=lambda run: run.cpu_s)


def once(command: str, folder: Path) -> Run:
    """Run a command to its end, in `folder`."""
    program, *words = command.split()
    start = [sys.executable, str(SCRIPTS / program)] if program.endswith(".py") else [_script(program)]
    before, begin = harness.children_cpu_s(), time.perf_counter()
    try:
        done = subprocess.run(
            [*start, *words],
            cwd=folder,
            capture_output=True,
            text=True,
            timeout=PATIENCE_S,
            check=False,
            env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
        )
        code, says = done.returncode, (done.stderr if done.returncode else "").strip()
    except subprocess.TimeoutExpired:
        code, says = None, ""
    return Run(command, code, says, time.perf_counter() - begin, harness.children_cpu_s() - before)


def _script(program: str) -> str:
    return str(Path(sys.executable).parent / program)


def written(refused: list[Run], helped: list[Run]) -> list[str]:
    """The section."""
    load = os.getloadavg()[0] / (os.cpu_count() or 1)
    return [
        *harness.heading("Time to the error", "; each command in a process of its own."),
        f"Of its runs the least, start and imports included. The load was {load:.1f} processes a core: CPU",
        "time is the fairer of the two. The aims on an idle machine: 1 s to an error, 0.5 s of CPU for",
        "`--help`.",
        "",
        *harness.table(
            "command | exit code | lines | s | CPU s",
            (
                f"`{r.command}` | {r.code} | {len(r.says.splitlines())} | {r.wall_s:.2f} | {r.cpu_s:.2f}"
                for r in refused
            ),
            right=True,
        ),
        "",
        *harness.table(
            "`--help` | exit code | s | CPU s",
            (f"`{r.command}` | {r.code} | {r.wall_s:.2f} | {r.cpu_s:.2f}" for r in helped),
            right=True,
        ),
        "",
        "`none` is not there, `link` is a symbolic link, `drive` a bag that fits, and `percent` a bag with",
        "its engine command in percent and without a grade.",
    ]


if __name__ == "__main__":
    main()
