"""The same controller before the physics truck, and over CAN before that truck's emulated controllers.

    python benchmarks/bench_can_loop.py [--policy POLICY] [--seconds 70]

Both runs are in real time behind the same leader; neither gets a parameter of its own. Prints a table and
writes docs/results/bench_can_loop.md.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from deeptruck_model.recordings import read

ROOT = Path(__file__).parents[1]
RESULTS = ROOT / "docs" / "results" / "bench_can_loop.md"
LEADER = "steps:speeds=20/23/18/20,every=15,acceleration=0.6"
TOPICS = {
    "speed": {"topic": "/truck/twist", "field": "twist.linear.x"},
    "gap": {"topic": "/leader/state", "field": "position[name=true_gap]"},
    "leader_speed": {"topic": "/leader/state", "field": "position[name=true_leader_speed]"},
}
TIME_GAP, FROM_S = 2.0, 10.0
RUNS = {
    "physics truck": ("start_simulation.py", "--simulator", "truck:trucksim"),
    "over CAN": ("start_vehicle.py", "--vehicle", "trucksim", "--emulator", "--engage", "--channel", "bench"),
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--policy", default="baseline:acc", help="policy directory, or baseline:NAME")
    parser.add_argument("--seconds", type=float, default=70.0)
    arguments = parser.parse_args()
    load = os.getloadavg()[0]
    with tempfile.TemporaryDirectory() as scratch:
        rows = {
            name: drive(Path(scratch), argv, arguments.policy, arguments.seconds)
            for name, argv in RUNS.items()
        }
    report(rows, Path(arguments.policy).name, load)


def drive(scratch: Path, argv: tuple[str, ...], policy: str, seconds: float) -> dict[str, float]:
    """One run and its errors. Raises CalledProcessError where it fails."""
    bag = scratch / argv[0].removesuffix(".py")
    common = ["--policy", policy, "--leader", LEADER, "--radar", "noisy", "--duration", str(seconds)]
    script = [sys.executable, str(ROOT / "ros2_ws" / argv[0]), *argv[1:]]
    recorded = ["--record", str(bag), "--runs", str(scratch / "runs")]
    subprocess.run([*script, *common, *recorded], check=True, env={**os.environ, "ROS_DOMAIN_ID": "97"})
    (followed,) = read(bag, topic_map=TOPICS)
    rows = followed.time > followed.start_s + FROM_S
    speed, gap, ahead = (followed.channels[n][rows] for n in ("speed", "gap", "leader_speed"))
    return {
        "rms time-gap error, s": float(np.sqrt(np.nanmean((gap / speed - TIME_GAP) ** 2))),
        "rms speed error, m/s": float(np.sqrt(np.nanmean((speed - ahead) ** 2))),
        "smallest gap, m": float(np.nanmin(gap)),
    }


def report(rows: dict[str, dict[str, float]], policy: str, load: float) -> None:
    names = list(rows)
    lines = [
        "# The same controller, simulated and over CAN",
        "",
        f"`python benchmarks/bench_can_loop.py --policy {policy}`; load average {load:.1f} before, on "
        f"{os.cpu_count()} cores. Goal: within 10 %.",
        "",
        f"| after {FROM_S:g} s | {' | '.join(names)} | ratio |",
        "| --- | --- | --- | --- |",
    ]
    for what in rows[names[0]]:
        direct, can = (rows[name][what] for name in names)
        lines.append(f"| {what} | {direct:.3f} | {can:.3f} | {can / direct:.2f} |")
    text = "\n".join(lines) + "\n"
    print(text)
    RESULTS.write_text(text)


if __name__ == "__main__":
    main()
